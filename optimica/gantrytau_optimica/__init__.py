"""Optimisation of models written with gantrytau, in the style of Optimica."""

from gantrytau_optimica.measurements import Samples
from gantrytau_optimica.optimization import (
    Free,
    Optimization,
    at,
    final,
    initial,
    integral_of_squares,
    link,
    sum_of_squares,
)
from gantrytau_optimica.optimize import Prepared, optimize, prepare
from gantrytau_optimica.optimum import Optimum

__all__ = [
    "Free",
    "Optimization",
    "Optimum",
    "Prepared",
    "Samples",
    "at",
    "final",
    "initial",
    "integral_of_squares",
    "link",
    "optimize",
    "prepare",
    "sum_of_squares",
]
