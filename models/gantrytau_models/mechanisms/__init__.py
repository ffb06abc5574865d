"""Linkages and robots."""
