"""The fit of a measured guideway: its columns, and what data must hold so that it can be made."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from gantrytau.border.checks import array
from gantrytau.border.refusal import Given, ModelError
from gantrytau.describing.record import Record
from gantrytau_optimica.calibration.data.findings import CalibrationError
from gantrytau_optimica.fitting.finding import DataRows, Finding
from gantrytau_optimica.fitting.robust import robust_deviations

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
MOVED = 1e-4  # m, more than a backlash: less, as a jittering encoder shows, is no change of direction
LONGEST = 100.0  # m, of a guideway; longer ones were given in mm
ASTRAY = 0.02  # of the length, off a straight line: no bend but a wrong number
APART = 1e-6  # of columns of length one: the least that they may differ
ABSOLUTE = 20  # rounds of weights that make the sum of squares one of sizes
SCALE = 0.05  # a guideway that measures another length by more than this is worth a question


@dataclass(frozen=True, eq=False)
class Basis(Record):
    """Columns of the fit: splines over knots, then backlash if there is one, then waves of the pitch."""

    knots: Array
    both: bool
    pitch: float | None
    harmonics: int

    def smooth(self, q: Array) -> Array:
        """Splines at q, (N, k); ModelError beyond the knots."""
        low, high = self.knots[0], self.knots[-1]
        if q.size and not (q.min() >= low - 1e-9 and q.max() <= high + 1e-9):
            raise ModelError(
                f"profile: found q from {q.min():g} to {q.max():g} m, expected positions within the measured {low:g} to "
                f"{high:g} m",
                argument="q",
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


def checked(q: Any, points: Any) -> tuple[Array, Array, Array, list[Finding]]:
    """Positions, points (N, d), their rows in the data as given, and findings; errors as of `linearity`."""
    q = array("linearity", "q", q, (None,), finite=False)
    points = array("linearity", "points", points, (len(q), 3), (len(q),), finite=False).reshape(len(q), -1)
    finite = np.isfinite(q) & np.isfinite(points).all(axis=1)
    rows, lost = np.flatnonzero(finite), np.flatnonzero(~finite)
    findings = []
    if lost.size:
        findings.append(Finding("nan", lost, (DataRows(lost), " hold no finite numbers and are left out")))
    if len(np.unique(q[rows])) < 2 * (DEGREE + 1):
        raise CalibrationError(
            f"linearity: found {len(np.unique(q[rows]))} different positions of the cart, expected {2 * (DEGREE + 1)} at "
            "the least; measure more points along the guideway",
            kind="too few points",
            rows=rows,
        )
    _refuse_wrong_numbers(q[rows], points[rows], rows)
    return q[rows], points[rows], rows, findings


def _refuse_wrong_numbers(q: Array, points: Array, rows: Array) -> None:
    """CalibrationError for millimetres, and for rows that are far off the straight line through most of the others."""
    order, half = np.argsort(q, kind="stable"), len(q) // 2
    before, after = order[: len(q) - half], order[half:]
    step = np.where(q[after] > q[before], q[after] - q[before], np.nan)
    direction = np.nanmedian((points[after] - points[before]) / step[:, None], axis=0)
    ahead = points - q[:, None] * direction
    off = np.linalg.norm(ahead - np.median(ahead, axis=0), axis=1)
    stroke = float(np.subtract(*np.quantile(q, (0.9, 0.1))))
    length = float(np.linalg.norm(direction)) * stroke
    if min(length, stroke) > LONGEST:
        raise CalibrationError(
            f"linearity: found a guideway of {np.ptp(q):.4g} m, expected some metres; give q, points and pitch in m",
            kind="millimetres",
            rows=rows,
        )
    astray = off > ASTRAY * length + EXACT
    if np.any(astray) and length > 0:
        raise CalibrationError(
            f"linearity: found points up to {off.max():.3g} m beside a straight line in ",
            DataRows(rows[astray]),
            ", expected those of one guideway; correct them, or leave them out",
            kind="outliers",
            rows=rows[astray],
        )


def approach(q: Array, rising: Any, rows: Array, given: int) -> Array:
    """The direction from which the cart came to each point, 1 or -1; the first counts as the second."""
    if rising is not None:
        found = array("linearity", "rising", rising, (given,))
        if not np.all(np.isin(found, (-1.0, 0.0, 1.0))):
            raise ModelError(
                "expected 1, -1 or 0 (unknown)", place="linearity", found=Given("rising", rising)
            )
        return found[rows]
    return _directions(q)


def _directions(q: Array) -> Array:
    """1 where q was last rising, -1 where falling, by MOVED from where it turned, (N,); the first ones as the next."""
    found, side, turn = np.zeros(len(q)), 0.0, q[0]
    for k, place in enumerate(q):
        if side * (place - turn) > 0:
            turn = place  # on in the same direction
        elif abs(place - turn) > MOVED:
            side, turn = float(np.sign(place - turn)), place
        found[k] = side
    return np.where(found == 0, found[np.argmax(found != 0)], found)


def axes_along(along: Array, up: Array) -> Array:
    """Rows along a unit vector, to the side and upwards, (d, d)."""
    if along.size == 1:
        return np.sign(along)[:, None]
    if not np.any(up):
        raise ModelError("expected a direction", place="linearity", found=Given("up", up))
    side = np.cross(up, along)
    if np.linalg.norm(side) < 1e-3 * np.linalg.norm(up):
        side = np.cross([1.0, 0.0, 0.0], along)  # a guideway that is itself upright
    side /= np.linalg.norm(side)
    return np.stack([along, side, np.cross(along, side)])


def _intervals(q: Array, pitch: float | None, intervals: int | None) -> int:
    if intervals is not None:
        return intervals
    longest = MOST_INTERVALS if pitch is None else np.ptp(q) / (PITCHES_PER_INTERVAL * pitch)
    return int(max(1, min(MOST_INTERVALS, longest, len(np.unique(q)) / ROWS_PER_UNKNOWN - DEGREE)))


def basis_of(q: Array, rising: Array, pitch: float | None, harmonics: int, intervals: int | None) -> Basis:
    """The columns of the fit, splines over as many intervals as asked for, or as the points allow."""
    both = bool(np.any(rising > 0) and np.any(rising < 0))
    basis = Basis(np.empty(0), both, pitch, harmonics)
    for count in range(_intervals(q, pitch, intervals), 0, -1):
        inner = np.linspace(q.min(), q.max(), count + 1)
        knots = np.concatenate([np.full(DEGREE, inner[0]), inner, np.full(DEGREE, inner[-1])])
        basis = Basis(knots, both, pitch, harmonics)
        if intervals is not None or _apart(basis.others(q, rising)):
            break
    return basis


def _apart(columns: Array) -> bool:
    """Whether columns can be told apart at the measured points: splines in a long gap cannot."""
    scaled = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-12)
    return len(columns) > columns.shape[1] and np.linalg.svd(scaled, compute_uv=False)[-1] >= APART


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
    if len(q) <= others.shape[1] + waves.shape[1] or not _apart(others):
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
    # the longest of those that look alike; its peak spans eight places
    first = int(np.argmax(alike >= ALIASED))
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
    left = _left_by_most(columns, points)
    fits = np.all(np.abs(left) <= STRAY * np.maximum(robust_deviations(left), EXACT), axis=1)
    if np.count_nonzero(fits) <= columns.shape[1]:
        fits = np.ones(len(points), dtype=bool)
    for _ in range(ROUNDS):  # one stray point bends the curve near it and makes its neighbours look stray
        left = points - columns @ np.linalg.lstsq(columns[fits], points[fits], rcond=None)[0]
        usual = robust_deviations(left[fits])
        before, fits = fits, np.all(np.abs(left) <= STRAY * np.maximum(usual, EXACT), axis=1)
        if np.array_equal(before, fits) or np.count_nonzero(fits) <= columns.shape[1]:
            break
    return fits


def _left_by_most(columns: Array, points: Array) -> Array:
    """What a curve leaves that makes the sum of sizes least, not of squares, so that a third of stray points is no harm."""
    basis = np.linalg.qr(columns)[0]
    left = points - basis @ (basis.T @ points)
    for _ in range(ABSOLUTE):
        usual = np.maximum(np.median(np.abs(left), axis=0), EXACT)
        weights = 1 / np.sqrt(np.sum((left / usual) ** 2, axis=1) + 1e-4)
        normal = (basis * weights[:, None]).T @ basis
        left = points - basis @ np.linalg.solve(normal, (basis * weights[:, None]).T @ points)
    return left


def outliers(stray: Array) -> list[Finding]:
    """The finding that rows are stray, if there are any."""
    if not stray.size:
        return []
    words = " do not fit the others; measure them again, or leave them out with "
    return [Finding("outliers", stray, (DataRows(stray), words, Given("loss", "robust")))]
