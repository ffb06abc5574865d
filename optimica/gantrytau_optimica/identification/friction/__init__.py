"""Friction of actuators, and the mass that they carry, from runs at constant speed."""
