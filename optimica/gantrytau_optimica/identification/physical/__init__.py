"""Masses, damping and stiffness of a structure from a model without physics."""
