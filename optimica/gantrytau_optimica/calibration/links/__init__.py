"""Closure equations of rods and arms, and how error models share their parameters."""
