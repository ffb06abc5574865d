"""Functions of a model for many points at once, as NumPy computes: one instruction for all points, then the next."""
