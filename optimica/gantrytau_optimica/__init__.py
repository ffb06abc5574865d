"""Optimisation of models written with gantrytau, in the style of Optimica."""

from gantrytau_optimica.optimization import Free, Optimization, at, final, initial
from gantrytau_optimica.optimize import Prepared, optimize, prepare
from gantrytau_optimica.optimum import Optimum

__all__ = ["Free", "Optimization", "Optimum", "Prepared", "at", "final", "initial", "optimize", "prepare"]
