"""Measured motion, and what is wrong with it."""
