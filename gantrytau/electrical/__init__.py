"""Circuits, and the motor that joins them to mechanics."""

from gantrytau.electrical.circuit import (
    Capacitor,
    CurrentSource,
    Ground,
    Inductor,
    Pin,
    Resistor,
    TwoPins,
    VoltageSource,
)
from gantrytau.electrical.motors import DcMotor, Emf

__all__ = [
    "Capacitor",
    "CurrentSource",
    "DcMotor",
    "Emf",
    "Ground",
    "Inductor",
    "Pin",
    "Resistor",
    "TwoPins",
    "VoltageSource",
]
