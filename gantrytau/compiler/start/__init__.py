"""Consistent start values, level by level."""
