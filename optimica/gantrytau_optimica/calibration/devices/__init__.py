"""Devices that measure a robot, as models."""
