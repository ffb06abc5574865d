"""Optima, looked up by the model's own names."""
