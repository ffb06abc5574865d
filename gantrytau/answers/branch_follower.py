"""Follows one branch of the solutions of f(y, q) = 0 from a point on it along a straight way of q, or says that it ends.

The way is q(s) = a + s (b - a), 0 <= s <= 1. Each trial step of s predicts along the tangent of the branch, at the same
time taking back what is left of f, and corrects once by Newton's method. It is accepted where the correction is small
beside the step, or beside such a step at the start, as unknowns that turn back stand still there; and where the Jacobians
before and after are alike, so that no singular one lies between. Else a smaller one is tried. Where the branch turns back
(a fold) or meets another one the steps become too small, and there is no answer. All that is compared is invariant to the
units of equations and unknowns.
"""

import casadi as ca
import numpy as np

from gantrytau.compiler.blocks.pivots import Scales

TRIALS = (24, 8)  # rounds of trials: a round that begins at the end of the way costs nothing
SMALLEST = 1e-13  # step, of the way
NEAR = 0.1  # of a step, by which it may be corrected
WANTED = 0.7  # of that
CHANGES = (0.1, 4.0)  # of a step after a trial
ALIKE = 1.5  # largest ratio of Jacobians before and after a step, pivot by pivot
ROUNDING = 1e-12  # of the unknowns, a correction that is none
NOTHING = 1e-300  # beside which no correction is compared: unknowns that are 0 and stay there


def follow(name: str, residual: ca.Function, start: ca.DM, begin: ca.DM, end: ca.MX) -> tuple[ca.MX, ca.MX]:
    """The unknowns at `end`, to some digits, and whether the branch leads there.

    residual: (y, q) -> f, (n,); start: y where q is `begin`. The result has no derivatives: it is a first guess.
    """
    n, count = start.numel(), begin.numel()
    rows, columns = sizes_at(residual, start, begin)
    along = residual_along(residual, begin, rows, columns)
    reach = reach_along(residual, start, begin, columns)
    state, q = ca.MX.sym("state", n + 2), ca.MX.sym("q", count)
    keep = ca.Function("keep", [state, q], [state])
    going = ca.logic_and(state[0] > 0, state[1] > SMALLEST)
    step = ca.Function.if_else("step", _trial(along, (begin, reach), n), keep)
    trial = ca.Function("trial", [state, q], [step(going, state, q)])
    found = state
    for _ in range(TRIALS[1]):
        found = trial(found, q)
    some = ca.Function.if_else("some", ca.Function("round", [state, q], [found]), keep)
    found = ca.vertcat(1.0, 1.0, start / columns)
    for _ in range(TRIALS[0]):
        going = ca.logic_and(found[0] > 0, found[1] > SMALLEST)
        found = some(going, found, q)
    whole = ca.Function(name, [q], [found[2:] * columns, found[0] == 0], {"is_diff_out": [False, False]})
    y, arrived = whole(end)
    return y, arrived


def sizes_at(residual: ca.Function, start: ca.DM, begin: ca.DM) -> tuple[ca.DM, ca.DM]:
    """Scales of rows and unknowns, from the Jacobian at the start."""
    numbers = np.array(ca.Function("jacobian", *_with_jacobian(residual))(start, begin))
    if not np.all(np.isfinite(numbers)):
        return ca.DM.ones(start.numel()), ca.DM.ones(start.numel())
    columns = 1 / Scales.of(ca.SX(numbers), numbers.ravel(order="F")[None]).columns
    rows = np.abs(numbers * columns).max(axis=1)
    return ca.DM(np.where(rows > 0, rows, 1.0)), ca.DM(columns)


def _with_jacobian(residual: ca.Function) -> tuple[list[ca.SX], list[ca.SX]]:
    y, q = residual.sx_in()
    return [y, q], [ca.densify(ca.jacobian(residual(y, q), y))]


def residual_along(residual: ca.Function, begin: ca.DM | None, rows: ca.DM, columns: ca.DM) -> ca.Function:
    """(z, s, b) -> residual, its Jacobian by z, its derivative by s; z are the unknowns in their sizes.

    begin: of the way; None where it stands below b, (2 k,).
    """
    k = residual.numel_in(1)
    z, s = ca.SX.sym("z", columns.numel()), ca.SX.sym("s")
    end = ca.SX.sym("end", k if begin is not None else 2 * k)
    first = end[k:] if begin is None else begin
    f = residual(z * columns, first + s * (end[:k] - first)) / rows
    parts = [ca.densify(f), ca.densify(ca.jacobian(f, z)), ca.densify(ca.jacobian(f, s))]
    return ca.Function("along", [z, s, end], parts, {"cse": True})


def reach_along(residual: ca.Function, start: ca.DM, begin: ca.DM, columns: ca.DM) -> ca.DM:
    """Squares of how far unknowns, in their sizes, go at first for one of each argument, were the others held."""
    y, q = residual.sx_in()
    f = residual(y, q)
    both = ca.Function("both", [y, q], [ca.densify(ca.jacobian(f, y)), ca.densify(ca.jacobian(f, q))])
    by_y, by_q = (np.array(m) for m in both(start, begin))
    if not (np.all(np.isfinite(by_y)) and np.all(np.isfinite(by_q))):
        return ca.DM.zeros(begin.numel())
    moves = np.linalg.lstsq(by_y * np.array(columns).T, by_q, rcond=None)[0]
    return ca.DM(np.sum(moves**2, axis=0))


def _trial(along: ca.Function, way: tuple[ca.DM, ca.DM], n: int) -> ca.Function:
    """(what is left of the way, step, z), b -> the same after one trial; way: where it begins, and reach along it."""
    begin, reach = way
    state, end = ca.MX.sym("state", n + 2), ca.MX.sym("end", begin.numel())
    left, h, z = state[0], state[1], state[2:]
    f, before, slope = along(z, 1 - left, end)
    step = -_solved(before, f + h * slope)
    f, after, _ = along(z + step, 1 - left + h, end)
    both = _solved(after, ca.horzcat(f, before))
    correction = -both[:, 0]
    usual = ca.sumsqr(step) + h**2 * ca.dot(reach, (end - begin) ** 2)
    beside = ca.sumsqr(correction) / (usual * NEAR**2 + ca.sumsqr(z) * ROUNDING**2 + NOTHING)
    corrected = ca.if_else(beside >= 0, ca.sqrt(beside), ca.inf)  # fmax would pass over NaN
    bend = ca.fmax(corrected, _change(n)(both[:, 1:]) / np.log(ALIKE))  # grows as the step does
    good = bend <= 1
    h = h * ca.fmax(ca.fmin(WANTED / bend, CHANGES[1]), CHANGES[0])
    rest = left - state[1]
    accepted = ca.vertcat(rest, ca.fmin(h, rest), z + step + correction)
    return ca.Function("trial", [state, end], [ca.if_else(good, accepted, ca.vertcat(left, h, z))])


def _solved(matrix: ca.MX, right: ca.MX) -> ca.MX:
    return right / matrix if matrix.numel() == 1 else ca.solve(matrix, right, "qr", {"eps": 0.0})


def pivots_of(matrix: ca.SX) -> list[ca.SX]:
    """The pivots of a matrix (n, n) in its order.

    There is one for each leading principal minor, so that they are positive if no singular matrix lies on the way from
    the identity.
    """
    n = matrix.shape[0]
    a = [[matrix[i, j] for j in range(n)] for i in range(n)]
    for k in range(n):
        for i in range(k + 1, n):
            factor = a[i][k] / a[k][k]
            for j in range(k + 1, n):
                a[i][j] -= factor * a[k][j]
    return [a[k][k] for k in range(n)]


def _change(n: int) -> ca.Function:
    """The largest logarithm of the pivots of a matrix, without signs; infinite where one is not positive."""
    matrix = ca.SX.sym("matrix", n, n)
    largest = ca.SX(0)
    for pivot in pivots_of(matrix):
        size = ca.if_else(pivot > 0, ca.fabs(ca.log(pivot)), ca.inf)
        largest = ca.if_else(largest > size, largest, size)
    return ca.Function("change", [matrix], [largest])
