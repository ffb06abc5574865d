"""Small problems as records of the transcription, below the language."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np

from gantrytau_optimica.control_problem import ControlProblem, FreeNumber, Limit, PointValue, Signal


def _ends(*columns):
    """Points "initial" and "final" of the states, held at given values (None: free)."""
    (states, first, last) = columns
    points, limits = [], []
    for name, values in (("initial", first), ("final", last)):
        if values is None:
            continue
        symbol = ca.SX.sym(name, len(values))
        points.append(PointValue(symbol, ca.vertcat(*states), name))
        limits.append(Limit(symbol, values, values, f"{name} state"))
    return {"points": tuple(points), "boundary": tuple(limits)}


def double_integrator(
    top_speed: float = np.inf, distance: float = 1.0, longest: float = 10.0
) -> ControlProblem:
    """From rest to rest in the least time with an acceleration of at most 1."""
    x, v, u, T = (ca.SX.sym(name) for name in ("x", "v", "u", "T"))
    return ControlProblem(
        states=(Signal("x", x, unit="m"), Signal("v", v, unit="m/s")),
        ode=ca.vertcat(v, u),
        inputs=(Signal("u", u, -1, 1, unit="m/s2"),),
        final_time=T,
        free=(FreeNumber("T", T, 0.1, longest, 1.0, unit="s"),),
        objective=T,
        path_limits=(Limit(v, -np.inf, top_speed, "speed", "m/s"),),
        **_ends((x, v), [0, 0], [distance, 0]),
    )


def van_der_pol(top: float = 0.75) -> ControlProblem:
    """Least squares over 20 s from (0, 1)."""
    x1, x2, u = (ca.SX.sym(name) for name in ("x1", "x2", "u"))
    return ControlProblem(
        states=(Signal("x1", x1), Signal("x2", x2, guess=np.ones_like)),
        ode=ca.vertcat((1 - x2**2) * x1 - x2 + u, x1),
        inputs=(Signal("u", u, max=top),),
        final_time=20.0,
        integrand=x1**2 + x2**2 + u**2,
        **_ends((x1, x2), [0, 1], None),
    )


def van_der_pol_minimum_time(start: float = 0.0) -> ControlProblem:
    """To rest in the least time."""
    problem, T = van_der_pol(), ca.SX.sym("T")
    states = ca.vertcat(*(state.symbol for state in problem.states))
    u = problem.inputs[0].symbol
    return replace(
        problem,
        inputs=(Signal("u", u, -1, 1),),
        start_time=start,
        final_time=T,
        free=(FreeNumber("T", T, start + 0.2, np.inf, start + 2.0),),
        objective=T,
        integrand=0.0,
        **_ends(ca.vertsplit(states), [0, 1], [0, 0]),
    )


def linear_quadratic(end: float = 4.0) -> ControlProblem:
    """A double integrator between two states in 3 s with the least squares."""
    x, v, u = (ca.SX.sym(name) for name in ("x", "v", "u"))
    return ControlProblem(
        states=(Signal("x", x), Signal("v", v)),
        ode=ca.vertcat(v, u),
        inputs=(Signal("u", u),),
        final_time=3.0,
        integrand=x**2 + v**2 + u**2,
        **_ends((x, v), [1, 2], [end, -2]),
    )


def reactor() -> ControlProblem:
    """The stirred tank reactor of Hicks and Ray."""
    c, T, Tc = (ca.SX.sym(name) for name in ("c", "T", "Tc"))
    F0, V, k0, E, dH, rho, Cp = 100 / 1000 / 60, 100, 7.2e10 / 60, 8750, -5e4, 1000, 239
    rate = k0 * c * ca.exp(-E / T)
    cooling = 2 * 915.6 / (0.219 * rho * Cp) * (Tc - T)
    return ControlProblem(
        states=(
            Signal("c", c, nominal=300, guess=lambda t: 300 + 0 * t),
            Signal("T", T, max=350, nominal=300, guess=lambda t: 300 + 0 * t),
        ),
        ode=ca.vertcat(F0 * (1000 - c) / V - rate, F0 * (350 - T) / V - dH / (rho * Cp) * rate + cooling),
        inputs=(Signal("Tc", Tc, 230, 370, nominal=300, guess=lambda t: 350 + 0 * t),),
        final_time=150.0,
        integrand=1e-4 * ((338.775766 - c) ** 2 + (280.099198 - T) ** 2 + (280 - Tc) ** 2),
        **_ends((c, T), [956.271065, 250.051971], None),
    )
