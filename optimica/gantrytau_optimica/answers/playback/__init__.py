"""Optima played back, and where they switch."""
