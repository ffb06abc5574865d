"""The same least squares by CasADi and Ipopt: another route to the minimum, with exact second derivatives."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from gantrytau import SolveError
from gantrytau_optimica.calibration.fitting.constraints import read_constraints
from gantrytau_optimica.calibration.fitting.gauss_newton import Minimum
from gantrytau_optimica.calibration.fitting.truncated_fit import TAPE, Fit, not_held
from gantrytau_optimica.calibration.rods.closure import Chain
from gantrytau_optimica.calibration.rods.groups import Group, problem

TOLERANCE = 1e-8  # deviations, about, of numbers: of the gradient of the cost in squares of the noise
LEAST = 1e-9  # m2, of the noise: rounding of closure errors is far below it
AT_LIMIT = 1e-7  # m, 1 or squares of these: nearer to a limit than this it holds the minimum back
# where rounding ends the descent before the gradient is that small
AT_ROUNDING = ("Search_Direction_Becomes_Too_Small", "Solved_To_Acceptable_Level")
OPTIONS = {
    "ipopt.print_level": 0,
    "print_time": False,
    "ipopt.sb": "yes",
    "ipopt.tol": TOLERANCE,
    "ipopt.acceptable_tol": TOLERANCE,
    "ipopt.nlp_scaling_method": "none",
    "ipopt.max_iter": 200,
}


def solve(fit: Fit) -> Fit:
    """The fit found again by Ipopt, from the start values of its group, with its weights and its prior.

    Directions that Gauss-Newton left alone are held where it left them by equality constraints. Raises SolveError
    where Ipopt finds no minimum.
    """
    group, free = fit.group, np.flatnonzero(fit.group.free)
    steps = _steps(fit)
    unknown = ca.MX.sym("x", len(free))
    x = ca.MX(ca.DM(group.x))
    x[free.tolist()] = ca.DM(fit.x[free]) + ca.DM(steps) @ unknown
    noise = float(np.sqrt(fit.minimum.cost / max(1, fit.count - fit.minimum.rank)))
    cost = _cost(fit, x, noise)
    held = unknown[fit.minimum.rank :]
    scaled = cost / max(noise, LEAST) ** 2
    solver = ca.nlpsol("calibration", "ipopt", {"x": unknown, "f": scaled, "g": held}, OPTIONS)
    start = np.linalg.solve(steps, group.x[free] - fit.x[free])
    start[fit.minimum.rank :] = 0.0
    found = solver(x0=start, lbg=0.0, ubg=0.0)
    stats = solver.stats()
    if not (stats["success"] or stats["return_status"] in AT_ROUNDING):
        raise SolveError(
            f"calibrate: Ipopt ended with {stats['return_status']} after {stats['iter_count']} iterations, expected a "
            "minimum; take method='gauss-newton', or start='linear'"
        )
    numbers = group.x.copy()
    numbers[free] = fit.x[free] + steps @ np.array(found["x"]).ravel()
    return replace(fit, minimum=_minimum(fit, numbers, int(stats["iter_count"])))


def _cost(fit: Fit, x: ca.MX, noise: float) -> ca.MX:
    """Squares of the weighted closure errors, and of deviations from the prior in units of the noise."""
    cost = ca.MX(0)
    for chain, places in zip(fit.group.chains, fit.group.places, strict=True):
        e = _errors(chain, x[places.tolist()])
        cost += ca.sumsqr(e if fit.weights is None else ca.DM(fit.weights) * e)
    for i, (value, deviation) in fit.group.prior.items():
        cost += (noise / deviation * (x[i] - value)) ** 2
    return cost


def solve_constrained(fits: Sequence[Fit], given: Any) -> list[Fit]:
    """All fits as one, by Ipopt, whose numbers keep constraints; from the minimum without them.

    Directions that data do not hold are drawn to where they are by a tape measure. Raises ModelError for constraints on
    what is not identified, SolveError where none or no minimum is found.
    """
    whole = _merged(fits)
    group, minimum, free = whole.group, whole.minimum, np.flatnonzero(whole.group.free)
    constraints = read_constraints(given, whole.free_names)
    noise = not_held(whole) * TAPE
    steps = _steps(whole)
    unknown = ca.MX.sym("x", len(free))
    numbers_of = ca.DM(minimum.x[free]) + ca.DM(steps) @ unknown
    x = ca.MX(ca.DM(group.x))
    x[free.tolist()] = numbers_of
    cost = max(noise, LEAST) ** 2 * ca.sumsqr(unknown[minimum.rank :]) + _cost(whole, x, noise)
    kept = ca.vertcat(*[each.expression(numbers_of) for each in constraints])
    low, high = (np.concatenate([getattr(each, side) for each in constraints]) for side in ("low", "high"))
    options = OPTIONS | {"ipopt.bound_relax_factor": 0.0}  # limits hold as they are said
    solver = ca.nlpsol(
        "calibration", "ipopt", {"x": unknown, "f": cost / max(noise, LEAST) ** 2, "g": kept}, options
    )
    found: Any = solver(x0=0.0, lbg=low, ubg=high)
    stats = solver.stats()
    if not (stats["success"] or stats["return_status"] in AT_ROUNDING):
        raise SolveError(
            f"calibrate: Ipopt ended with {stats['return_status']} after {stats['iter_count']} iterations, expected a "
            "minimum that keeps the constraints; look whether they contradict each other"
        )
    numbers = group.x.copy()
    numbers[free] = minimum.x[free] + steps @ np.array(found["x"]).ravel()
    value = np.array(found["g"]).ravel()
    active = np.minimum(value - low, high - value) < AT_LIMIT
    slopes = np.array(ca.Function("slopes", [unknown], [ca.jacobian(kept, unknown)])(found["x"]))
    slopes = slopes @ np.linalg.inv(steps)
    return [_constrained(whole, numbers, slopes[active], int(stats["iter_count"]))]


def _steps(fit: Fit) -> np.ndarray:
    """One deviation of the numbers along each direction, of those that data do not hold by TAPE, in columns, (n, n).

    In these steps the curvature of the cost is the same along all directions.
    """
    minimum = fit.minimum
    noise = max(not_held(fit) * TAPE, LEAST)
    sizes = np.full(len(minimum.directions), TAPE)
    sizes[: minimum.rank] = noise / minimum.singular[: minimum.rank]
    return minimum.directions.T * sizes


def _constrained(fit: Fit, x: np.ndarray, kept: np.ndarray, iterations: int) -> Fit:
    """The fit at x, which moves only across the slopes of the constraints it keeps."""
    weights = None if fit.weights is None else [fit.weights] * len(fit.group.chains)
    found = problem(fit.group, weights, not_held(fit) * TAPE)
    J = found.slopes(x)[:, fit.group.free]
    _, sizes, rows = np.linalg.svd(kept, full_matrices=True)
    across = rows[int((sizes > 1e-9 * sizes.max(initial=0.0)).sum()) :]
    _, singular, inside = np.linalg.svd(J @ across.T, full_matrices=False)
    rank = int((singular > not_held(fit)).sum())
    minimum = Minimum(x, found.errors(x), J, singular, inside @ across, rank, iterations, True)
    return replace(fit, minimum=minimum)


def _merged(fits: Sequence[Fit]) -> Fit:
    """Several fits as one, whose numbers stand one after another."""
    starts = np.cumsum([0, *(len(fit.x) for fit in fits)])
    group = Group(
        tuple(chain for fit in fits for chain in fit.group.chains),
        tuple(
            places + start
            for fit, start in zip(fits, starts[:-1], strict=True)
            for places in fit.group.places
        ),
        tuple(name for fit in fits for name in fit.group.names),
        np.concatenate([fit.group.x for fit in fits]),
        np.concatenate([fit.group.free for fit in fits]),
        {
            i + int(start): v
            for fit, start in zip(fits, starts[:-1], strict=True)
            for i, v in fit.group.prior.items()
        },
    )
    held, lost = [], []
    ends = np.cumsum([0, *(int(fit.group.free.sum()) for fit in fits)])
    for fit, first in zip(fits, ends[:-1], strict=True):
        wide = np.zeros((len(fit.minimum.directions), int(ends[-1])))
        wide[:, first : first + int(fit.group.free.sum())] = fit.minimum.directions
        held.append(wide[: fit.minimum.rank])
        lost.append(wide[fit.minimum.rank :])
    rank = sum(fit.minimum.rank for fit in fits)
    singular = np.concatenate([fit.minimum.singular[: fit.minimum.rank] for fit in fits])
    minimum = Minimum(
        np.concatenate([fit.x for fit in fits]),
        np.concatenate([fit.minimum.errors for fit in fits]),
        np.zeros((0, int(ends[-1]))),
        np.concatenate([singular, np.zeros(sum(map(len, lost)))]),
        np.vstack([*held, *lost]),
        rank,
        max(fit.minimum.iterations for fit in fits),
        all(fit.minimum.success for fit in fits),
    )
    return Fit(group, minimum, max(fit.smallest for fit in fits), fits[0].weights)


def _errors(chain: Chain, p: ca.MX) -> ca.MX:
    """Closure errors (N, 1), as `Chain.error` writes them, all poses by one function that is mapped."""
    N = len(chain.q)
    numbers, q, T, R = ca.SX.sym("p", chain.size), ca.SX.sym("q"), ca.SX.sym("T", 3), ca.SX.sym("R", 3, 3)
    if chain.points is None:
        along = q * numbers[4:7]
        data = chain.q[None]
    else:  # Q a with the rotation vector as exponential
        a, w = ca.SX.sym("a", 3), numbers[4:7]
        turned = ca.DM(np.eye(3) if chain.turned is None else chain.turned)
        along = _turn(w) @ turned @ a
        q, data = a, chain.points.T
    y = T - numbers[1:4] - along
    given, columns = [q, T], [data, chain.r.T]
    if chain.R is not None:
        y += R @ numbers[7:10]
        given.append(ca.vec(R))
        columns.append(chain.R.transpose(2, 1, 0).reshape(9, N))
    one = ca.Function("closure", [numbers, *given], [ca.sumsqr(y) - numbers[0] ** 2])
    return one.map(N)(ca.repmat(p, 1, N), *(ca.DM(c) for c in columns)).T


def _turn(w: ca.SX) -> ca.SX:
    """exp([w]x), smooth at 0."""
    angle = ca.sqrt(ca.sumsqr(w) + 1e-20)
    K = ca.skew(w)
    return ca.SX.eye(3) + ca.sin(angle) / angle * K + (1 - ca.cos(angle)) / angle**2 * K @ K


def _minimum(fit: Fit, x: np.ndarray, iterations: int) -> Minimum:
    """The record of the minimum at x, with slopes as Gauss-Newton keeps them."""
    group, old = fit.group, fit.minimum
    noise = float(np.sqrt(old.cost / max(1, fit.count - old.rank)))
    weights = None if fit.weights is None else [fit.weights] * len(group.chains)
    found = problem(group, weights, noise)
    J = found.slopes(x)[:, group.free]
    _, singular, directions = np.linalg.svd(J, full_matrices=False)
    return Minimum(x, found.errors(x), J, singular, directions, old.rank, iterations, True)
