"""The parameters of one arm from measured poses, by Gauss-Newton with truncated minimum-norm steps.

    J S = U diag(s) V'      p <- p - S V1 diag(1/s1) U1' e,   s1 >= noise / tape

S scales each unknown to the metres that it moves a joint by. Directions with a singular value below noise / tape are
known worse from the data than from a tape measure: the step leaves them alone, so they keep their nominal values, and no
parameter has to be fixed by hand. J is triangularised in blocks of poses that stay in the cache, so condition is not
squared. Dressler (2012), section 5.4, which fixes a set of parameters instead.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gantrytau import ModelError
from gantrytau_optimica.calibration.rods.arms import Arm

NOISE = 1e-5  # m, of a laser tracker at two metres
TAPE = 1e-2  # m, what a tape measure gives
LEVER = 0.25  # m, a turn by 1 rad, or a quaternion by 1/2, moves the joints on a turntable about this far
BLOCK = 1024  # poses; Jacobians of 38 columns for them take 1 MB
TOLERANCE = 1e-11  # m; steps shrink by the ratio of noise to size, 1e-5, each
HUBER = 1.345  # standard deviations: 95 % as efficient as least squares where noise is normal (Huber, 1981)


Data = tuple[np.ndarray, np.ndarray, np.ndarray | None]


@dataclass(frozen=True, eq=False)
class ArmFit:
    """The arm as it was fitted.

    arm: with its new values; iterations: steps taken; success: whether they converged; residuals: closure errors
    (N, m) in m; rank: how many directions the data hold; deviation: of one closure error, in m;
    covariance: (p, p) of the unknowns in the directions that are held, zero in others; links of one pose share the error
    of its measurement, so it uses the covariance of their residuals and not their deviation alone.
    """

    arm: Arm
    iterations: int
    success: bool
    residuals: np.ndarray
    rank: int
    deviation: float
    covariance: np.ndarray


def fit_arm(
    arm: Arm,
    q: np.ndarray,
    r: np.ndarray,
    R: np.ndarray | None,
    *,
    noise: float = NOISE,
    tape: float = TAPE,
    prior: Mapping[str, float] | None = None,
    loss: str = "linear",
    steps: int = 50,
) -> ArmFit:
    """Fit the unknowns of an arm to measured poses.

    q: (N, n); r: (N, 3) in m; R: (N, 3, 3) or None; noise, tape: standard deviations in m, of a measured closure error
    and of nominal values; prior: standard deviations by name of vectors or scalars, about the nominal values;
    loss: "linear", or "robust" (Huber) against outliers; steps: how many at most.
    Raises ModelError for other words, unknown names, arrays whose shapes do not fit or numbers that are not finite.
    """
    if loss not in ("linear", "robust"):
        raise ModelError(f"loss: found {loss!r}, expected 'linear' or 'robust'")
    q, r, R = checked_poses(arm, q, r, R)
    scale, pulls = scales(arm), prior_pulls(arm, prior, noise)
    moved, success, taken = np.zeros(arm.count), False, 0
    weights = np.ones((len(q), len(arm.links)))
    factor = triangle(arm, q, r, R, scale, weights)
    while taken < steps and not success:
        step = _step(factor, pulls * scale, pulls * moved, noise / tape) * scale
        arm, factor, step = _shortened(arm, factor, step, (pulls, moved), (q, r, R, scale, weights))
        moved, taken = moved + step, taken + 1
        success = bool(np.linalg.norm(step / scale) < TOLERANCE)
        if loss == "robust":
            weights = huber(arm.closure(q, r, R)[0], noise)
            factor = triangle(arm, q, r, R, scale, weights)
    return fitted(arm, (q, r, R), (taken, success), (factor, scale, pulls), noise / tape)


def scales(arm: Arm) -> np.ndarray:
    """What of each unknown moves a joint by a metre, (p,)."""
    turning = [".rotation[" in name or ".gain" in name for name in arm.names]
    quaternion = [".orientation[" in name for name in arm.names]
    return np.where(turning, 1 / LEVER, np.where(quaternion, 0.5 / LEVER, 1.0))


def triangle(
    arm: Arm,
    q: np.ndarray,
    r: np.ndarray,
    R: np.ndarray | None,
    scale: np.ndarray,
    weights: np.ndarray | None = None,
    root: np.ndarray | None = None,
) -> np.ndarray:
    """The triangular factor F of [J S, e] over all poses, (p + 1, p + 1): F'F = [J S, e]' [J S, e].

    weights: (N, m) for the squares of the rows, or None; root: (m, c) or (N, m, c), makes it F'F = [..]' root root' [..].
    """
    factor = np.zeros((0, arm.count + 1))
    for start in range(0, len(q), BLOCK):
        part = slice(start, start + BLOCK)
        e, J = arm.closure(q[part], r[part], None if R is None else R[part])
        rows = np.concatenate([J * scale, e[:, :, None]], axis=2)
        if weights is not None:
            rows *= np.sqrt(weights[part])[:, :, None]
        if root is not None:
            rows = np.swapaxes(root if root.ndim == 2 else root[part], -1, -2) @ rows
        factor = np.linalg.qr(np.vstack([factor, rows.reshape(-1, arm.count + 1)]), mode="r")
    return np.asarray(factor)


def half_covariance(factor: np.ndarray, spread: np.ndarray, least: float) -> tuple[np.ndarray, int]:
    """C with C C' the covariance of the scaled unknowns in the directions that are held, and how many those are.

    factor: that of J S, with p columns; spread: that of root' J S, root root' the covariance of the errors of a pose;
    C = (S J'J S)^-1 spread' within the directions of singular values from `least`.
    """
    _, s, V = np.linalg.svd(factor, full_matrices=False)
    held = s >= least
    return V[held].T @ ((V[held] @ spread.T) / s[held, None] ** 2), int(held.sum())


def checked_poses(
    arm: Arm, q: np.ndarray, r: np.ndarray, R: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """The measurements as arrays of floats, once their shapes and numbers are right; raises ModelError."""
    q, r = np.asarray(q, dtype=float), np.asarray(r, dtype=float)
    R = None if R is None else np.asarray(R, dtype=float)
    columns = 1 + max([arm.cart, *(each.column for each in arm.turntables)])
    if arm.links == (arm.name,):
        R = None  # the plate of such an arm keeps its orientation, whatever was measured of it
    elif R is None:
        raise ModelError(
            f"{arm.name}: found no orientations R, expected (N, 3, 3); the plate of this robot turns"
        )
    shapes = [array.shape for array in (q, r, *([] if R is None else [R]))]
    expected = [(len(q), max(columns, q.shape[-1])), (len(q), 3), (len(q), 3, 3)][: len(shapes)]
    if len(q) == 0 or shapes != expected:
        raise ModelError(
            f"{arm.name}: found q, r, R of the shapes {shapes}, expected (N, {columns}), (N, 3), (N, 3, 3), N > 0"
        )
    finite = np.isfinite(q).all(axis=1) & np.isfinite(r).all(axis=1)
    finite &= True if R is None else np.isfinite(R).all(axis=(1, 2))
    if not finite.all():
        rows = ", ".join(map(str, np.flatnonzero(~finite)[:10]))
        raise ModelError(
            f"{arm.name}: found numbers that are not finite in rows {rows}; leave those poses out"
        )
    return q, r, R


def _step(factor: np.ndarray, pulls: np.ndarray, pulled: np.ndarray, least: float) -> np.ndarray:
    """The minimum-norm step of the scaled unknowns in the directions whose singular value is at least `least`."""
    matrix, errors = factor[:, :-1], factor[:, -1]
    if pulls.any():
        matrix, errors = np.vstack([matrix, np.diag(pulls)]), np.concatenate([errors, pulled])
    U, s, V = np.linalg.svd(matrix, full_matrices=False)
    held = s >= least * (1 - 1e-6)  # a prior as wide as a tape measure counts
    return -V[held].T @ ((U[:, held].T @ errors) / s[held])


def _shortened(
    arm: Arm, factor: np.ndarray, step: np.ndarray, prior: tuple[np.ndarray, np.ndarray], data: tuple
) -> tuple[Arm, np.ndarray, np.ndarray]:
    """The arm after the step, or half or a quarter of it and so on where the whole makes the sum of squares larger."""
    pulls, moved = prior
    cost = np.hypot(np.linalg.norm(factor[:, -1]), np.linalg.norm(pulls * moved)) * (1 + 1e-9)  # rounding
    halvings = 0
    while True:
        part = step / 2**halvings
        candidate = arm.moved(part)
        after = triangle(candidate, *data)
        found = np.hypot(np.linalg.norm(after[:, -1]), np.linalg.norm(pulls * (moved + part)))
        if found <= cost or halvings == 8:
            return candidate, after, part
        halvings += 1


def prior_pulls(arm: Arm, prior: Mapping[str, float] | None, noise: float) -> np.ndarray:
    """Weights of the nominal values against a closure error, (p,); ModelError for names that the arm does not have."""
    pulls, names = np.zeros(arm.count), arm.names
    for name, deviation in (prior or {}).items():
        found = [k for k, each in enumerate(names) if each == name or each.rpartition("[")[0] == name]
        if not found or not deviation > 0:
            raise ModelError(
                f"prior: found {name!r} with {deviation!r}, expected a standard deviation above 0 for one of "
                f"{', '.join(arm.free)}, or an element of it"
            )
        pulls[found] = noise / deviation
    return pulls


def huber(residuals: np.ndarray, noise: float) -> np.ndarray:
    """Weights by Huber, of errors against their median deviation, (N, m)."""
    sizes = np.abs(residuals)
    deviation = np.maximum(1.4826 * np.median(sizes, axis=0), noise)  # of a normal distribution
    return np.minimum(1.0, HUBER * deviation / np.maximum(sizes, 1e-300))


def fitted(arm: Arm, data: Data, outcome: tuple[int, bool], system: tuple, least: float) -> ArmFit:
    """The record of a fit. data: (q, r, R); outcome: iterations and success; system: triangle, scale and pulls."""
    factor, scale, pulls = system
    residuals = arm.closure(*data)[0]
    degrees = max(1.0, len(residuals) - arm.count / len(arm.links))  # each link has its share of the unknowns
    _, s, V = np.linalg.svd(residuals, full_matrices=False)
    spread = triangle(arm, *data, scale, root=V.T * s / np.sqrt(degrees))[:, :-1]
    # what a prior says has errors of its own, as large as its deviation
    noise = np.sqrt((residuals**2).sum() / degrees / len(arm.links))
    rows = np.vstack([factor[:, :-1], np.diag(pulls * scale)])
    half, rank = half_covariance(
        rows, np.vstack([spread, noise * np.diag(pulls * scale)]), least * (1 - 1e-6)
    )
    half = scale[:, None] * half
    return ArmFit(arm, *outcome, residuals, rank, float(noise), half @ half.T)
