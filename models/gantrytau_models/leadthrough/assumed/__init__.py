"""Surfaces and people: values that are assumed, not printed."""
