"""Robots on rods of known length: closed forms, Newton, branches."""
