"""Guideways and error maps, looked at by themselves."""
