"""Some of the optimal control problems in rockit, as its user writes them: states, rates, limits, ends and cost."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

ELEMENTS, POINTS = 50, 3
IPOPT = {"print_level": 0, "sb": "yes", "max_iter": 3000, "max_cpu_time": 20.0}
Expression = Any


@dataclass(frozen=True)
class Written:
    """x' = rates(x, u) from `start` to the ends that are given; one of objective (of the final time and x) and integrand.

    time: final time, or its guess and limits; inputs: least, greatest and guessed value; limits: state -> least, greatest.
    """

    time: float | tuple[float, float, float]
    start: Sequence[float]
    rates: Callable[[Any, Any], Sequence[Expression]]
    inputs: Sequence[tuple[float, float, float]]
    ends: Mapping[int, float]
    objective: Callable[[Any, Any], Expression] | None = None
    integrand: Callable[[Any, Any], Expression] | None = None
    limits: Mapping[int, tuple[float, float]] = field(default_factory=dict)


def _fastest(T: Any, x: Any) -> Expression:
    return T


def _robot_arm(x: Any, u: Any) -> list[Expression]:
    inertia = ((5 - x[0]) ** 3 + x[0] ** 3) / 3
    return [x[1], u[0] / 5, x[3], u[1] / (inertia * ca.sin(x[4]) ** 2), x[5], u[2] / inertia]


def _rocket(x: Any, u: Any) -> list[Expression]:
    drag = 310 * x[1] ** 2 * ca.exp(-500 * (x[0] - 1))
    return [x[1], (u[0] - drag) / x[2] - 1 / x[0] ** 2, -2 * u[0]]


def _glider(x: Any, u: Any) -> list[Expression]:
    r = (x[0] / 100 - 2.5) ** 2
    w = x[3] - 2.5 * (1 - r) * ca.exp(-r)
    v = ca.sqrt(x[2] ** 2 + w**2)
    drag, lift = 0.5 * (0.034 + 0.069662 * u[0] ** 2) * 1.13 * 14 * v, 0.5 * u[0] * 1.13 * 14 * v
    return [x[2], x[3], (-lift * w - drag * x[2]) / 100, (lift * x[2] - drag * w) / 100 - 9.80665]


def _cart_pole(x: Any, u: Any) -> list[Expression]:
    s, c = ca.sin(x[2]), ca.cos(x[2])
    pull, det = u[0] + 0.15 * x[3] ** 2 * s, 0.15 * c**2 - 0.65
    return [x[1], (-0.15 * 9.81 * s * c - 0.5 * pull) / det, x[3], (1.3 * 9.81 * s + c * pull) / det]


PROBLEMS = {
    "BrysonDenham": Written(
        1.0, (0, 1), lambda x, u: [x[1], u[0]], [(-np.inf, np.inf, 0.0)], {0: 0.0, 1: -1.0},
        integrand=lambda x, u: u[0] ** 2 / 2, limits={0: (-np.inf, 1 / 9)},
    ),
    "Brachistochrone": Written(
        (1.0, 0.1, 10.0), (0, 10, 0), lambda x, u: [x[2] * ca.sin(u[0]), -x[2] * ca.cos(u[0]), 9.80665 * ca.cos(u[0])],
        [(0.0, np.pi, 1.0)], {0: 10.0, 1: 5.0}, _fastest,
    ),
    "MoonLander": Written(
        (1.0, 0.1, 10.0), (1, -0.783, 1), lambda x, u: [x[1], -1 + u[0] / x[2], -u[0] / 2.349], [(0.0, 1.227, 0.0)],
        {0: 0.0, 1: 0.0}, lambda T, x: -x[2],
    ),
    "CatalystMixing": Written(
        1.0, (1, 0),
        lambda x, u: [u[0] * (10 * x[1] - x[0]), u[0] * (x[0] - 10 * x[1]) - (1 - u[0]) * x[1]], [(0.0, 1.0, 0.5)], {},
        lambda T, x: x[0] + x[1] - 1,
    ),
    "ParticleSteering": Written(
        (1.0, 0.01, 10.0), (0, 0, 0, 0), lambda x, u: [x[2], x[3], 100 * ca.cos(u[0]), 100 * ca.sin(u[0])],
        [(-np.pi / 2, np.pi / 2, 0.0)], {1: 5.0, 2: 45.0, 3: 0.0}, _fastest,
    ),
    "Goddard": Written(
        (0.2, 0.01, 1.0), (1, 0, 1), _rocket, [(0.0, 3.5, 1.75)], {2: 0.6}, lambda T, x: -x[0],
        limits={0: (0.99, np.inf), 2: (0.6, np.inf)},
    ),
    "RobotArm": Written(
        (5.0, 1.0, 50.0), (4.5, 0, 0, 0, np.pi / 4, 0), _robot_arm, [(-1.0, 1.0, 0.0)] * 3,
        {0: 4.5, 1: 0.0, 2: 2 * np.pi / 3, 3: 0.0, 4: np.pi / 4, 5: 0.0}, _fastest,
    ),
    "HangGlider": Written(
        (100.0, 10.0, 200.0), (0, 1000, 13.2275675, -1.28750052), _glider, [(0.0, 1.4, 0.7)],
        {1: 900.0, 2: 13.2275675, 3: -1.28750052}, lambda T, x: -x[0], limits={0: (0.0, np.inf), 2: (1.0, np.inf)},
    ),
    "SwingUp": Written(
        2.0, (0, 0, 0, 0), _cart_pole, [(-20.0, 20.0, 0.0)], {0: 1.0, 1: 0.0, 2: np.pi, 3: 0.0},
        integrand=lambda x, u: u[0] ** 2, limits={0: (-2.0, 2.0)},
    ),
}  # fmt: skip


def solved(name: str) -> str:
    """The objective, iterations and processor time of a problem, or in words why there is none; "" for others."""
    if name not in PROBLEMS:
        return ""
    try:
        begin = time.process_time()
        objective, iterations = _solve(PROBLEMS[name])
        return f"{objective:.7g} in {iterations} it, {time.process_time() - begin:.2g} s"
    except ImportError:
        return ""
    except Exception as error:  # whatever a peer says is its answer
        return f"no answer: {type(error).__name__}"


def _solve(problem: Written) -> tuple[float, int]:
    from rockit import DirectCollocation, FreeTime, Ocp  # pyright: ignore[reportMissingImports]

    horizon: Any = FreeTime(problem.time[0]) if isinstance(problem.time, tuple) else problem.time
    ocp: Any = Ocp(T=horizon)
    x, u = ocp.state(len(problem.start)), ocp.control(len(problem.inputs))
    ocp.set_der(x, ca.vertcat(*problem.rates(x, u)))
    ocp.subject_to(ocp.at_t0(x) == ca.DM(list(problem.start)))
    way = [problem.ends.get(k, first) - first for k, first in enumerate(problem.start)]  # straight lines
    guessed = problem.time[0] if isinstance(problem.time, tuple) else problem.time
    ocp.set_initial(x, ca.DM(list(problem.start)) + ocp.t / guessed * ca.DM(way))
    ocp.set_initial(u, ca.DM([guess for *_, guess in problem.inputs]))
    for k, (least, greatest, _) in enumerate(problem.inputs):
        if np.isfinite(least):
            ocp.subject_to(least <= (u[k] <= greatest))
    for k, (least, greatest) in problem.limits.items():
        if np.isfinite(least):
            ocp.subject_to(x[k] >= least)
        if np.isfinite(greatest):
            ocp.subject_to(x[k] <= greatest)
    for k, value in problem.ends.items():
        ocp.subject_to(ocp.at_tf(x[k]) == value)
    if isinstance(problem.time, tuple):
        ocp.subject_to(ocp.T >= problem.time[1])
        ocp.subject_to(ocp.T <= problem.time[2])
    cost = problem.objective(ocp.T, ocp.at_tf(x)) if problem.objective else 0.0
    cost = cost + (ocp.integral(problem.integrand(x, u)) if problem.integrand else 0.0)
    ocp.add_objective(cost)
    ocp.solver("ipopt", {"expand": True, "print_time": False, "ipopt": IPOPT})
    ocp.method(DirectCollocation(N=ELEMENTS, degree=POINTS, scheme="radau"))
    solution = ocp.solve()
    return float(solution.value(cost)), int(solution.stats["iter_count"])
