"""Minimum-time motions from components, beside the same motions written by hand for three other ways to solve them."""
