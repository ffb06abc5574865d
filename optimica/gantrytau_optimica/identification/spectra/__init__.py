"""Inputs and outputs sampled together, and their spectra."""
