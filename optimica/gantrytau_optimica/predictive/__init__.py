"""Optimal control in the loop: a problem solved anew at every sample, from what is measured."""
