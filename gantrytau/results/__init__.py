"""Signals over time by name: the record, its files and figures."""
