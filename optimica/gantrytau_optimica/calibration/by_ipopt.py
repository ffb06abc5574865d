"""The same least squares by CasADi and Ipopt: another route to the minimum, with exact second derivatives."""

from dataclasses import replace

import casadi as ca
import numpy as np

from gantrytau import SolveError
from gantrytau_optimica.calibration.closure import Chain
from gantrytau_optimica.calibration.fitting import Fit
from gantrytau_optimica.calibration.gauss_newton import Minimum
from gantrytau_optimica.calibration.groups import problem

TOLERANCE = 1e-8  # of the gradient of the scaled cost
SCALE = 1e4  # of the cost in m4, so that this gradient leaves less than 1e-10 m
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

    Directions that were left alone by Gauss-Newton are held at their start by equality constraints. Raises SolveError
    where Ipopt finds no minimum.
    """
    group, free = fit.group, np.flatnonzero(fit.group.free)
    unknown = ca.MX.sym("x", len(free))
    x = ca.MX(ca.DM(group.x))
    x[free.tolist()] = unknown
    cost = ca.MX(0)
    for chain, places in zip(group.chains, group.places, strict=True):
        e = _errors(chain, x[places.tolist()])
        cost += ca.sumsqr(e if fit.weights is None else ca.DM(fit.weights) * e)
    noise = float(np.sqrt(fit.minimum.cost / max(1, fit.count - fit.minimum.rank)))
    for i, (value, deviation) in group.prior.items():
        cost += (noise / deviation * (x[i] - value)) ** 2
    lost = ca.DM(fit.minimum.directions[fit.minimum.rank :])
    held = lost @ (unknown - ca.DM(group.x[free]))
    solver = ca.nlpsol("calibration", "ipopt", {"x": unknown, "f": SCALE * cost, "g": held}, OPTIONS)
    found = solver(x0=group.x[free], lbg=0.0, ubg=0.0)
    stats = solver.stats()
    if not (stats["success"] or stats["return_status"] in AT_ROUNDING):
        raise SolveError(
            f"calibrate: Ipopt ended with {stats['return_status']} after {stats['iter_count']} iterations, expected a "
            "minimum; take method='gauss-newton', or start='linear'"
        )
    numbers = group.x.copy()
    numbers[free] = np.array(found["x"]).ravel()
    return replace(fit, minimum=_minimum(fit, numbers, int(stats["iter_count"])))


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
