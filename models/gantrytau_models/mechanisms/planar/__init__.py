"""Linkages in a plane."""
