"""Paths to follow, and how they are made from points and recordings."""
