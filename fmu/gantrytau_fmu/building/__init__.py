"""Platforms, compilers, and the archive."""
