"""Measured poses, and what is wrong with them."""
