"""Calibration of any robot by the names of its parameters."""
