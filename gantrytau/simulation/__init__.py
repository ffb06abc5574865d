"""Simulation on all coordinates, from instant to instant."""
