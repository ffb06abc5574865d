"""Servos of actuators from measured steps."""
