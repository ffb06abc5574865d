"""The same initial value problem by SciPy's Radau and by IDA of scikit-SUNDAE, on the equations of the translated model."""

import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from gantrytau import time as model_time
from gantrytau import translate
from gantrytau.simulation.motion import all_coordinates

LONGEST = 20.0  # s of processor time


class TooLong(Exception):
    """A peer that takes longer than LONGEST."""


def ends_by_peers(
    model: Any, stop: float, tolerance: float
) -> dict[str, tuple[Mapping[str, float], float] | str]:
    """Name of the peer -> state -> value at the end, and processor time, s; or in words why there is none.

    Constraints are differentiated until there are rates of all states, which start consistently; nothing holds them later.
    Forces that are not linear in these equations stay unknowns: of index one, for IDA alone.
    """
    coordinates = all_coordinates(translate(model), {})
    x, z, _ = coordinates.start(0.0, np.zeros(0))
    rate, unknown = coordinates.ode, coordinates.x
    moving = np.ones(x.size)  # what has a rate
    if z.size:  # forces
        matrix = ca.jacobian(coordinates.algebraic, coordinates.z)
        if ca.depends_on(matrix, coordinates.z):
            rate, unknown = ca.vertcat(rate, coordinates.algebraic), ca.vertcat(unknown, coordinates.z)
            moving, x = np.append(moving, np.zeros(z.size)), np.append(x, z)
        else:
            right = ca.substitute(coordinates.algebraic, coordinates.z, ca.SX.zeros(z.size))
            rate = ca.substitute(rate, coordinates.z, ca.solve(matrix, -right))
    rate = ca.substitute(rate, coordinates.t0, 0.0)
    arguments = [model_time, unknown]
    f = ca.Function("f", arguments, [rate], {"cse": True})
    jacobian = ca.Function("j", arguments, [ca.densify(ca.jacobian(rate, unknown))], {"cse": True})
    sizes = np.array(coordinates.sizes or [])
    sizes = np.append(sizes, np.ones(x.size - sizes.size))
    found: dict[str, tuple[Mapping[str, float], float] | str] = {}
    for name, solve in (("radau", _radau), ("ida", partial(_ida, moving=moving))):
        if name == "radau" and not moving.all():
            found[name] = "not explicit"
            continue
        begin = time.process_time()

        def watched(t: float, y: np.ndarray, begin: float = begin) -> np.ndarray:
            if time.process_time() - begin > LONGEST:
                raise TooLong
            return np.asarray(f(t, y)).ravel()

        try:
            end = solve(watched, lambda t, y: np.asarray(jacobian(t, y)), x, stop, tolerance, sizes)
            found[name] = (
                dict(zip(coordinates.states, end.tolist(), strict=False)),
                time.process_time() - begin,
            )
        except TooLong:
            found[name] = f"longer than {LONGEST:g} s"
        except Exception as error:  # whatever a peer says is its answer
            found[name] = f"{type(error).__name__}: {error}".splitlines()[0]
    return found


Rates = Callable[[float, np.ndarray], np.ndarray]


def _radau(
    f: Rates, jacobian: Rates, x: np.ndarray, stop: float, tolerance: float, sizes: np.ndarray
) -> np.ndarray:
    found = solve_ivp(f, (0.0, stop), x, "Radau", rtol=tolerance, atol=tolerance * sizes, jac=jacobian)
    if not found.success:
        raise ArithmeticError(found.message)
    return found.y[:, -1]


def _ida(
    f: Rates,
    jacobian: Rates,
    x: np.ndarray,
    stop: float,
    tolerance: float,
    sizes: np.ndarray,
    moving: np.ndarray,
) -> np.ndarray:
    from sksundae.ida import IDA  # pyright: ignore[reportMissingImports]

    def residual(t: float, y: np.ndarray, yp: np.ndarray, res: np.ndarray) -> None:
        res[:] = moving * yp - f(t, y)

    def slopes(t: float, y: np.ndarray, yp: np.ndarray, res: np.ndarray, cj: float, JJ: np.ndarray) -> None:
        JJ[:] = cj * np.diag(moving) - jacobian(t, y)

    solver: Any = IDA(
        residual,
        jacfn=slopes,
        rtol=tolerance,
        atol=tolerance * sizes,
        max_num_steps=10_000_000,
        algebraic_idx=np.flatnonzero(moving == 0) if not moving.all() else None,
    )
    found = solver.solve(np.array([0.0, stop]), x, moving * f(0.0, x))
    if not found.success:
        raise ArithmeticError(found.message)
    return found.y[-1]
