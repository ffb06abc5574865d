"""The same least squares by CasADi and Ipopt: another route to the minimum, with exact second derivatives."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np
from scipy.linalg import block_diag

from gantrytau import SolveError
from gantrytau.border import Given
from gantrytau_optimica.calibration.fitting.constraints import AT_LIMIT, ParameterConstraint, read_constraints
from gantrytau_optimica.calibration.fitting.rod_fit import Fit
from gantrytau_optimica.calibration.fitting.symbolic_closure import errors_of
from gantrytau_optimica.calibration.links.groups import Group
from gantrytau_optimica.fitting.least_squares import Minimum

TOLERANCE = 1e-8  # deviations, about, of parameters: of the gradient of the cost in squares of the noise
ROUNDED = 1e-6  # the same of closure errors of turntables, whose roundings leave 5e-7
LEAST = 1e-9  # m2 or m, of the noise: rounding of closure errors is far below it
LEAST_STEP = 1e-6  # the same where parameters are led to a limit, in steps of their deviations
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


def solve(fits: Sequence[Fit], constraints: Mapping[str, Any] | None = None) -> list[Fit]:
    """The fits found again by Ipopt, with their weights and priors: each from the start values of its group; or all as one,
    from the minimum of Gauss-Newton, whose parameters keep constraints.

    Directions that Gauss-Newton left alone stay where it left them, or with constraints are drawn there by a tape measure.
    ModelError for constraints on what is not identified, SolveError where Ipopt finds no minimum.
    """
    if not constraints:
        return [_solved(fit, []) for fit in fits]
    whole = _merged(fits)
    return [_solved(whole, read_constraints(constraints, whole.free_names))]


def _solved(fit: Fit, constraints: Sequence[ParameterConstraint]) -> Fit:
    group, rank, free = fit.group, fit.minimum.rank, np.flatnonzero(fit.group.free)
    noise = max(fit.noise, LEAST_STEP if constraints else LEAST)
    steps, middle = _steps(fit, noise), fit.x[free]
    unknown = ca.MX.sym("x", len(free))
    free_of = ca.DM(middle) + ca.DM(steps) @ unknown
    x = ca.MX(ca.DM(group.x))
    x[free.tolist()] = free_of
    rows, lost = _residuals(fit, x, noise), unknown[rank:]
    if constraints:
        rows = ca.vertcat(lost, rows)
        kept = ca.vertcat(*[each.expression(free_of) for each in constraints])
        low, high = (
            np.concatenate([getattr(each, side) for each in constraints]) for side in ("low", "high")
        )
        start, exact = np.zeros(len(free)), {"ipopt.bound_relax_factor": 0.0}  # limits hold as they are said
        remedy = [" that keeps the constraints; look whether they contradict each other"]
    else:
        kept, low, high, exact = lost, np.zeros(lost.numel()), np.zeros(lost.numel()), {}
        start = np.linalg.solve(steps, group.x[free] - middle)
        start[rank:] = 0.0
        remedy = ["; take ", Given("method", "gauss-newton"), ", or ", Given("start", "linear")]
    solver = _solver(rows, unknown, kept, bool(group.arms), OPTIONS | exact)
    found, stats = solver(x0=start, lbg=low, ubg=high), solver.stats()
    if not (stats["success"] or stats["return_status"] in AT_ROUNDING):
        raise SolveError(
            f"Ipopt ended with {stats['return_status']} after {stats['iter_count']} iterations, expected a minimum",
            *remedy,
            place="calibrate",
        )
    parameters = group.x.copy()
    parameters[free] = middle + steps @ np.array(found["x"]).ravel()
    across = np.eye(len(free))
    if constraints:
        value = np.array(found["g"]).ravel()
        active = np.minimum(value - low, high - value) < AT_LIMIT
        normals = np.array(ca.Function("normals", [unknown], [ca.jacobian(kept, unknown)])(found["x"]))[
            active
        ]
        normals = normals @ np.linalg.inv(steps) * group.scale[free]
        _, sizes, across = np.linalg.svd(normals, full_matrices=True)
        across = across[int((sizes > 1e-9 * sizes.max(initial=0.0)).sum()) :]
    at = group.condensed(fit.weights).minimum(
        parameters, fit.noise, smallest=fit.smallest, along=across, steps=0
    )
    rank = at.rank if constraints else rank
    minimum = replace(at, rank=rank, iterations=int(stats["iter_count"]), success=True)
    return replace(fit, minimum=minimum)


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


def _steps(fit: Fit, noise: float) -> np.ndarray:
    """One deviation of the parameters along each direction, of those that data do not hold by tape, in columns, (n, n).

    In these steps the curvature of the cost is the same along all directions.
    """
    minimum = fit.minimum
    sizes = np.full(len(minimum.directions), fit.group.tape)
    sizes[: minimum.rank] = noise / minimum.singular[: minimum.rank]
    return minimum.directions.T * sizes * fit.group.scale[fit.group.free][:, None]


def _merged(fits: Sequence[Fit]) -> Fit:
    """Several fits as one, whose parameters stand one after another."""
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
    minimum = Minimum(
        x=np.concatenate([m.x for m in minima]),
        residuals=np.concatenate([m.residuals for m in minima]),
        jacobian=np.zeros((0, len(held) + len(lost))),
        singular=np.concatenate([*(m.singular[: m.rank] for m in minima), np.zeros(len(lost))]),
        directions=np.vstack([held, lost]),
        rank=len(held),
        scale=np.concatenate([m.scale for m in minima]),
        iterations=max(m.iterations for m in minima),
        success=all(m.success for m in minima),
    )
    return Fit(group, minimum, fits[0].weights)
