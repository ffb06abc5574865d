"""Masses, friction, servos and compliance of robots from measured motion."""
