"""Rods and arms brought to their minima, and how sure their numbers are."""
