"""The same least squares by CasADi and Ipopt: another route to the minimum, with exact second derivatives."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import block_diag

from gantrytau import SolveError
from gantrytau_optimica.calibration.fitting.constraints import AT_LIMIT, read_constraints
from gantrytau_optimica.calibration.fitting.gauss_newton import Minimum
from gantrytau_optimica.calibration.fitting.least_squares import problem
from gantrytau_optimica.calibration.fitting.rod_fit import Fit, noise_of, not_held
from gantrytau_optimica.calibration.fitting.symbolic_closure import errors_of
from gantrytau_optimica.calibration.links.groups import Group

TOLERANCE = 1e-8  # deviations, about, of numbers: of the gradient of the cost in squares of the noise
ROUNDED = 1e-6  # the same of closure errors of turntables, whose roundings leave 5e-7
LEAST = 1e-9  # m2 or m, of the noise: rounding of closure errors is far below it
LEAST_STEP = 1e-6  # the same where numbers are led to a limit, in steps of their deviations
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
    noise = max(noise_of(fit.minimum, fit.group), LEAST)
    steps = _steps(fit, noise)
    unknown = ca.MX.sym("x", len(free))
    x = ca.MX(ca.DM(group.x))
    x[free.tolist()] = ca.DM(fit.x[free]) + ca.DM(steps) @ unknown
    rows, held = _residuals(fit, x, noise), unknown[fit.minimum.rank :]
    solver = _solver(rows, unknown, held, bool(group.arms), OPTIONS)
    start = np.linalg.solve(steps, group.x[free] - fit.x[free])
    start[fit.minimum.rank :] = 0.0
    found, steps_taken = _solved(
        solver, "a minimum; take method='gauss-newton', or start='linear'", x0=start, lbg=0.0, ubg=0.0
    )
    numbers = group.x.copy()
    numbers[free] = fit.x[free] + steps @ np.array(found["x"]).ravel()
    left = problem(group, fit.weights, noise_of(fit.minimum, group))
    J = left.slopes(numbers)[:, group.free]
    _, singular, directions = np.linalg.svd(J, full_matrices=False)
    rank = fit.minimum.rank
    return replace(
        fit, minimum=Minimum(numbers, left.errors(numbers), J, singular, directions, rank, steps_taken, True)
    )


def _solved(solver: ca.Function, expected: str, **given: Any) -> tuple[Any, int]:
    """What Ipopt found, and in how many iterations; SolveError where it is no minimum."""
    found, stats = solver(**given), solver.stats()
    if not (stats["success"] or stats["return_status"] in AT_ROUNDING):
        raise SolveError(
            f"calibrate: Ipopt ended with {stats['return_status']} after {stats['iter_count']} iterations, expected "
            f"{expected}"
        )
    return found, int(stats["iter_count"])


def _residuals(fit: Fit, x: ca.MX, noise: float) -> ca.MX:
    """Weighted closure errors, and deviations from the prior, in units of the noise."""
    rows = []
    for e in errors_of(fit.group, x):
        rows.append(ca.vec(e if fit.weights is None else ca.repmat(ca.DM(fit.weights), 1, e.shape[1]) * e))
    for i, (value, deviation) in fit.group.prior.items():
        rows.append(noise / deviation * (x[i] - value))
    return ca.vertcat(*rows) / noise


def _solver(rows: ca.MX, unknown: ca.MX, kept: ca.MX, arms: bool, options: dict[str, Any]) -> ca.Function:
    """Ipopt for the sum of squares of rows, subject to limits of kept.

    arms: with turntables, whose second derivatives turn the cost down far from the minimum: Gauss-Newton's take their place.
    """
    problem = {"x": unknown, "f": ca.sumsqr(rows), "g": kept}
    if arms:
        J, by_cost, by_kept = ca.jacobian(rows, unknown), ca.MX.sym("f"), ca.MX.sym("g", kept.numel())
        curved = 2 * by_cost * (J.T @ J) + ca.hessian(ca.dot(by_kept, kept), unknown)[0]
        arguments = [unknown, ca.MX.sym("p", 0, 0), by_cost, by_kept]
        options = options | dict.fromkeys(("ipopt.tol", "ipopt.acceptable_tol"), ROUNDED)
        options |= {"hess_lag": ca.Function("hess_lag", arguments, [ca.triu(ca.densify(curved))])}
    return ca.nlpsol("calibration", "ipopt", problem, options)


def solve_constrained(fits: Sequence[Fit], given: Any) -> list[Fit]:
    """All fits as one, by Ipopt, whose numbers keep constraints; from the minimum without them.

    Directions that data do not hold are drawn to where they are by a tape measure. Raises ModelError for constraints on
    what is not identified, SolveError where none or no minimum is found.
    """
    whole = _merged(fits)
    group, minimum, free = whole.group, whole.minimum, np.flatnonzero(whole.group.free)
    constraints = read_constraints(given, whole.free_names)
    noise = max(noise_of(whole.minimum, group), LEAST_STEP)
    unknown = ca.MX.sym("x", len(free))
    steps, begin = _steps(whole, noise), minimum.x[free]
    numbers_of = ca.DM(begin) + ca.DM(steps) @ unknown
    x = ca.MX(ca.DM(group.x))
    x[free.tolist()] = numbers_of
    rows = ca.vertcat(unknown[minimum.rank :], _residuals(whole, x, noise))
    kept = ca.vertcat(*[each.expression(numbers_of) for each in constraints])
    low, high = (np.concatenate([getattr(each, side) for each in constraints]) for side in ("low", "high"))
    options = OPTIONS | {"ipopt.bound_relax_factor": 0.0}  # limits hold as they are said
    solver = _solver(rows, unknown, kept, bool(group.arms), options)
    expected = "a minimum that keeps the constraints; look whether they contradict each other"
    found, iterations = _solved(solver, expected, x0=0.0, lbg=low, ubg=high)
    numbers = group.x.copy()
    numbers[free] = begin + steps @ np.array(found["x"]).ravel()
    value = np.array(found["g"]).ravel()
    active = np.minimum(value - low, high - value) < AT_LIMIT
    slopes = np.array(ca.Function("slopes", [unknown], [ca.jacobian(kept, unknown)])(found["x"]))
    slopes = slopes @ np.linalg.inv(steps) * group.scale[free]
    return [_constrained(whole, numbers, slopes[active], iterations)]


def _steps(fit: Fit, noise: float) -> np.ndarray:
    """One deviation of the numbers along each direction, of those that data do not hold by tape, in columns, (n, n).

    In these steps the curvature of the cost is the same along all directions.
    """
    minimum = fit.minimum
    sizes = np.full(len(minimum.directions), fit.group.tape)
    sizes[: minimum.rank] = noise / minimum.singular[: minimum.rank]
    return minimum.directions.T * sizes * fit.group.scale[fit.group.free][:, None]


def _constrained(fit: Fit, x: np.ndarray, kept: np.ndarray, iterations: int) -> Fit:
    """The fit at x, which moves only across the slopes of the constraints it keeps."""
    found = problem(fit.group, fit.weights, noise_of(fit.minimum, fit.group))
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
    groups, minima = [fit.group for fit in fits], [fit.minimum for fit in fits]
    placed = list(zip(groups, starts[:-1].tolist(), strict=True))
    group = Group(
        tuple(chain for group in groups for chain in group.chains),
        tuple(places + start for group, start in placed for places in group.places),
        tuple(name for group in groups for name in group.names),
        np.concatenate([group.x for group in groups]),
        np.concatenate([group.free for group in groups]),
        np.concatenate([group.scale for group in groups]),
        {i + start: v for group, start in placed for i, v in group.prior.items()},
        groups[0].noise,
        groups[0].tape,
    )
    held = np.asarray(block_diag(*[m.directions[: m.rank] for m in minima]))
    lost = np.asarray(block_diag(*[m.directions[m.rank :] for m in minima]))
    singular = np.concatenate([*(m.singular[: m.rank] for m in minima), np.zeros(len(lost))])
    minimum = Minimum(
        np.concatenate([m.x for m in minima]),
        np.concatenate([m.errors for m in minima]),
        np.zeros((0, len(singular))),
        singular,
        np.vstack([held, lost]),
        len(held),
        max(m.iterations for m in minima),
        all(m.success for m in minima),
    )
    return Fit(group, minimum, max(fit.smallest for fit in fits), fits[0].weights)
