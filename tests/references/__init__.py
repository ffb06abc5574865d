"""Dynamics of small mechanisms written by hand with NumPy: the second route to numbers of translated models."""
