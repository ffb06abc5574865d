"""The fit of a measured guideway: its columns, and what data must hold so that it can be made."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from gantrytau.errors import ModelError
from gantrytau_optimica.calibration.findings import CalibrationError, Finding, rows_in_words

Array = np.ndarray
DEGREE = 3  # of the splines of the smooth part
MOST_INTERVALS = 12  # of the splines, if nothing else limits them
ROWS_PER_UNKNOWN = 3  # fewest measured points for each interval of the splines
PITCHES_PER_INTERVAL = 3  # so that a spline cannot follow what repeats with the pitch
HIDDEN = 0.3  # of a wave that is left when splines and backlash are taken out: below, they imitate it
ALIASED = 0.95  # likeness of two waves at the measured points, from which on they cannot be told apart
ROUNDS = 5  # of looking for stray points
EXACT = 1e-9  # m, below which nothing is stray
BLOCK = 64  # waves that are compared at once
STRAY = 5.0  # robust standard deviations, beyond which a point does not fit
SCALE = 0.05  # a guideway that measures another length by more than this is worth a question


@dataclass(frozen=True, eq=False)
class Basis:
    """Columns of the fit: splines over knots, then backlash if there is one, then waves of the pitch."""

    knots: Array
    both: bool
    pitch: float | None
    harmonics: int

    def smooth(self, q: Array) -> Array:
        """Splines at q, (N, k); ModelError beyond the knots."""
        low, high = self.knots[0], self.knots[-1]
        if q.size and (q.min() < low - 1e-9 or q.max() > high + 1e-9):
            raise ModelError(
                f"profile: found q from {q.min():g} to {q.max():g} m, expected positions within the measured {low:g} to "
                f"{high:g} m"
            )
        from scipy.interpolate import BSpline

        return BSpline.design_matrix(np.clip(q, low, high), self.knots, DEGREE).toarray()

    def others(self, q: Array, rising: Array) -> Array:
        """All columns but the waves."""
        return np.column_stack([self.smooth(q), -rising / 2]) if self.both else self.smooth(q)

    def waves(self, q: Array) -> Array:
        """Cosine and sine of each harmonic, (N, 2 h)."""
        if self.pitch is None:
            return np.zeros((len(q), 0))
        angle = 2 * np.pi * q[:, None] * np.arange(1, self.harmonics + 1) / self.pitch
        return np.stack([np.cos(angle), np.sin(angle)], axis=2).reshape(len(q), -1)


def checked(
    q: Any, points: Any, pitch: float | None, harmonics: int, loss: str
) -> tuple[Array, Array, Array, list[Finding]]:
    """Positions, points (N, d), their rows in the data as given, and findings; errors as of `linearity`."""
    q, points = np.asarray(q, dtype=float), np.asarray(points, dtype=float)
    points = points[:, None] if points.ndim == 1 else points
    if q.ndim != 1 or points.shape not in ((len(q), 3), (len(q), 1)):
        raise ModelError(
            f"linearity: found q of shape {q.shape} and points of shape {points.shape}, expected (N,) and (N, 3), or (N,) "
            "for lengths along the axis"
        )
    if pitch is not None and not pitch > 0:
        raise ModelError(f"linearity: found pitch={pitch!r}, expected a length above 0 in m")
    if loss not in ("linear", "robust"):
        raise ModelError(f"linearity: found loss={loss!r}, expected 'linear' or 'robust'")
    if harmonics < 1:
        raise ModelError(
            f"linearity: found harmonics={harmonics!r}, expected 1 or more; leave pitch out for no waves"
        )
    finite = np.isfinite(q) & np.isfinite(points).all(axis=1)
    rows, lost = np.flatnonzero(finite), np.flatnonzero(~finite)
    findings = []
    if lost.size:
        words = f"{rows_in_words(lost)} hold no finite numbers and are left out"
        findings.append(Finding("nan", lost, words))
    if len(np.unique(q[rows])) < 2 * (DEGREE + 1):
        raise CalibrationError(
            f"linearity: found {len(np.unique(q[rows]))} different positions of the cart, expected {2 * (DEGREE + 1)} at "
            "the least; measure more points along the guideway",
            kind="too few points",
            rows=rows,
        )
    return q[rows], points[rows], rows, findings


def approach(q: Array, rising: Any, rows: Array, given: int) -> Array:
    """The direction from which the cart came to each point, 1 or -1; the first counts as the second."""
    if rising is not None:
        found = np.asarray(rising, dtype=float)
        if found.shape != (given,) or not np.all(np.isin(found, (-1.0, 0.0, 1.0))):
            raise ModelError(
                "linearity: found rising of another length than q, or with values other than 1, -1 and 0 (unknown); "
                "expected one for each row"
            )
        return found[rows]
    step = np.sign(np.diff(q, prepend=np.nan))
    step[~np.isfinite(step)] = 0.0
    moved = np.maximum.accumulate(
        np.where(step != 0, np.arange(len(q)), 0)
    )  # repeated points keep their direction
    step = step[moved]
    return np.where(step == 0, step[np.argmax(step != 0)], step)


def axes_along(along: Array, up: Array) -> Array:
    """Rows along a unit vector, to the side and upwards, (d, d)."""
    if along.size == 1:
        return np.sign(along)[:, None]
    side = np.cross(up, along)
    if np.linalg.norm(side) < 1e-3 * np.linalg.norm(up) or not np.any(up):
        side = np.cross([1.0, 0.0, 0.0], along)  # a guideway that is itself upright
    side /= np.linalg.norm(side)
    return np.stack([along, side, np.cross(along, side)])


def _intervals(q: Array, pitch: float | None, intervals: int | None) -> int:
    if intervals is not None:
        if intervals < 1:
            raise ModelError(f"linearity: found intervals={intervals!r}, expected 1 or more")
        return intervals
    longest = MOST_INTERVALS if pitch is None else np.ptp(q) / (PITCHES_PER_INTERVAL * pitch)
    return int(max(1, min(MOST_INTERVALS, longest, len(np.unique(q)) / ROWS_PER_UNKNOWN - DEGREE)))


def basis_of(q: Array, rising: Array, pitch: float | None, harmonics: int, intervals: int | None) -> Basis:
    """The columns of the fit, splines over as many intervals as asked for, or as the points allow."""
    inner = np.linspace(q.min(), q.max(), _intervals(q, pitch, intervals) + 1)
    knots = np.concatenate([np.full(DEGREE, inner[0]), inner, np.full(DEGREE, inner[-1])])
    return Basis(knots, bool(np.any(rising > 0) and np.any(rising < 0)), pitch, harmonics)


def scale_findings(size: float, rows: Array) -> list[Finding]:
    """Whether points move as far as the cart; CalibrationError if one was given in mm."""
    if not 0.01 < size < 100:
        raise CalibrationError(
            f"linearity: found points that move by {size:.4g} m for each m of q, expected about 1; give both in m",
            kind="millimetres",
            rows=rows,
        )
    if abs(size - 1) < SCALE:
        return []
    words = f"points move by {size:.4f} m for each m of q; check the gear ratio, or take it as transmission factor"
    return [Finding("scale", rows, words)]


def refuse_hidden(basis: Basis, q: Array, rising: Array, rows: Array) -> None:
    """CalibrationError where the columns of the fit cannot be told apart at the measured points."""
    others, waves = basis.others(q, rising), basis.waves(q)
    scaled = others / np.maximum(np.linalg.norm(others, axis=0), 1e-12)
    if len(q) <= others.shape[1] + waves.shape[1] or np.linalg.svd(scaled, compute_uv=False)[-1] < 1e-6:
        raise CalibrationError(
            f"linearity: {len(q)} points cannot determine {others.shape[1] + waves.shape[1]} unknowns, expected more "
            "points, without long gaps; or take fewer intervals",
            kind="too few points",
            rows=rows,
        )
    rest = np.linalg.qr(others)[0]
    left = waves - rest @ (rest.T @ waves)
    if waves.size and np.linalg.svd(left, compute_uv=False)[-1] < HIDDEN * np.sqrt(len(q) / 2):
        raise CalibrationError(
            f"linearity: at these positions a wave of {basis.pitch:g} m looks like the bend of the guideway, like backlash "
            "or like its own harmonics; measure at uneven distances, below half of the pitch",
            kind="cyclic",
            rows=rows,
        )


def aliased(q: Array, pitch: float | None, rows: Array) -> list[Finding]:
    """Whether a longer wave looks the same as that of the pitch at the measured points, as evenly spaced ones make it."""
    if pitch is None:
        return []
    lowest = 1 / np.ptp(q)
    frequencies = np.arange(lowest, 0.9 / pitch, lowest / 8)
    wave = np.exp(2j * np.pi * q / pitch)
    alike = np.zeros(len(frequencies))
    for first in range(0, len(frequencies), BLOCK):
        part = slice(first, first + BLOCK)
        longer = np.exp(2j * np.pi * q[:, None] * frequencies[part])
        alike[part] = np.maximum(np.abs(wave @ longer), np.abs(wave @ longer.conj())) / len(q)
    if not alike.size or alike.max() < ALIASED:
        return []
    first = int(
        np.argmax(alike >= ALIASED)
    )  # the longest of those that look alike; its peak spans eight places
    period = 1 / frequencies[first + int(np.argmax(alike[first : first + 8]))]
    words = (
        f"at these positions a wave of the pitch of {1e3 * pitch:.3g} mm looks like one of {1e3 * period:.3g} mm; measure "
        "at uneven distances, or below half of the pitch"
    )
    return [Finding("aliased", rows, words)]


def fitted(columns: Array, error: Array) -> tuple[Array, Array, Array]:
    """Coefficients (k, d), their covariance for noise of one (k, k), noise (d,)."""
    orthogonal, triangle = np.linalg.qr(columns)
    coefficients = np.linalg.solve(triangle, orthogonal.T @ error)
    left = error - columns @ coefficients
    inverse = np.linalg.inv(triangle)
    noise = np.sqrt(np.sum(left**2, axis=0) / (len(columns) - columns.shape[1]))
    return coefficients, inverse @ inverse.T, noise


def fitting(columns: Array, points: Array) -> Array:
    """Which points fit a curve through those that do, (N,)."""
    fits = np.ones(len(points), dtype=bool)
    for _ in range(ROUNDS):  # one stray point bends the curve near it and makes its neighbours look stray
        left = points - columns @ np.linalg.lstsq(columns[fits], points[fits], rcond=None)[0]
        usual = 1.4826 * np.median(np.abs(left[fits]), axis=0)  # 1.4826: of normal noise
        before, fits = fits, np.all(np.abs(left) <= STRAY * np.maximum(usual, EXACT), axis=1)
        if np.array_equal(before, fits) or np.count_nonzero(fits) <= columns.shape[1]:
            break
    return fits


def outliers(stray: Array) -> list[Finding]:
    """The finding that rows are stray, if there are any."""
    if not stray.size:
        return []
    words = f"{rows_in_words(stray)} do not fit the others; measure them again, or leave them out with loss='robust'"
    return [Finding("outliers", stray, words)]
