"""Rods and arms brought to their minima, and how sure their parameters are."""
