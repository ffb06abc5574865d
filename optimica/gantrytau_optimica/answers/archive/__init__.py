"""Optima on file, and records of runs."""
