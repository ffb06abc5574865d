"""Looking at a guideway that was measured alone: is it straight, does the drive err with each tooth, has it backlash?

    P(q) = P(0) + q v + e(q)                                   Dressler (2012), (4.10)
    along the axis e . v / |v|, across it e - (e . v) v / |v|^2   (4.11), (4.12) with the vector that is meant there

The error is then split, by one least-squares fit, into a smooth part (the guideway is bent), a part that repeats with
the pitch of rack and pinion, and a step between the two directions of motion (backlash); what is left is noise, from
which all standard errors follow.
"""

import os
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from gantrytau.border.checks import array, check_words, number, whole
from gantrytau.border.refusal import Given, ModelError
from gantrytau.describing.record import Record
from gantrytau_optimica.calibration.error_analysis.guideway_fit import (
    HIDDEN,
    Basis,
    aliased,
    approach,
    axes_along,
    basis_of,
    checked,
    fitted,
    fitting,
    outliers,
    refuse_hidden,
    scale_findings,
)
from gantrytau_optimica.fitting.finding import Finding

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class Cyclic(Record):
    """What repeats with the pitch (m): amplitude * cos(2 pi harmonic q / pitch - phase).

    amplitude, its standard error amplitude_error (m) and phase (rad): (harmonics, d), columns as of `Linearity.error`.
    """

    pitch: float
    amplitude: Array
    amplitude_error: Array
    phase: Array


@dataclass(frozen=True, eq=False)
class Linearity(Record):
    """A guideway as measured. d is 3, or 1 if only lengths along it were measured. Lengths in m.

    q (N,); rising (N,): 1 where the cart came with rising q, -1 with falling, 0 unknown; start (d,), direction (d,):
    P(0) and v of (4.10), not normalised; axes (d, d): rows along the guideway, across to the side, across upwards.
    error (N, d): e in these axes; noise (d,): standard deviation of what is left. cyclic: None without a pitch;
    backlash: P at the same q with falling q minus that with rising q, along the axis, with its standard error
    backlash_error; None if all rows came from one side. rows: of the data as given; findings: kinds "nan",
    "outliers", "aliased", "scale".
    """

    q: Array
    rising: Array
    start: Array
    direction: Array
    axes: Array
    error: Array
    noise: Array
    cyclic: Cyclic | None
    backlash: float | None
    backlash_error: float | None
    rows: Array
    findings: tuple[Finding, ...]
    basis: Basis = field(repr=False)
    coefficients: Array = field(repr=False)
    covariance: Array = field(repr=False)

    @property
    def along(self) -> Array:
        """Error along the axis, (N,) (4.11)."""
        return self.error[:, 0]

    @property
    def across(self) -> Array:
        """Size of the error across the axis, (N,) (4.12); zeros if only lengths were measured."""
        return np.linalg.norm(self.error[:, 1:], axis=1)

    @property
    def size(self) -> Array:
        """Size of the error, (N,), of which Table 4.1 prints mean and standard deviation."""
        return np.linalg.norm(self.error, axis=1)

    def profile(self, q: Any) -> tuple[Array, Array]:
        """The smooth part at positions q (M,), columns as of `error`, and its standard errors, (M, d) each in m.

        Positions beyond the measured ones raise ModelError.
        """
        rows = self.basis.smooth(np.atleast_1d(array("profile", "q", q, (), (None,))))
        count = rows.shape[1]
        variance = np.einsum("mi,ij,mj->m", rows, self.covariance[:count, :count], rows)
        return rows @ self.coefficients[:count], np.sqrt(variance)[:, None] * self.noise

    @cached_property
    def straightness(self) -> Array:
        """Height of the smooth part, highest less lowest measured place, of each column of `error`, (d,) in m."""
        return np.ptp(self.profile(self.q)[0], axis=0)

    def spectrum(self, periods: Any) -> Array:
        """Amplitudes in m of waves of the periods (F,) in m, fitted one by one to error, beside smooth part and backlash.

        A least-squares spectrum, columns as of `error`, (F, d): it needs no even spacing. A wave that smooth part or
        backlash can imitate is NaN. Raises ModelError for periods that are not above zero.
        """
        periods = np.atleast_1d(array("spectrum", "periods", periods, (), (None,)))
        if not np.all(periods > 0):
            raise ModelError(
                "expected lengths above 0 in m", place="spectrum", found=Given("periods", periods)
            )
        rest = np.linalg.qr(self.basis.others(self.q, self.rising))[0]
        left = self.error - rest @ (rest.T @ self.error)
        wave = np.exp(2j * np.pi * self.q[:, None] / periods)
        pair = np.stack([wave.real, wave.imag], axis=1).reshape(len(self.q), -1)
        pair = (pair - rest @ (rest.T @ pair)).reshape(len(self.q), 2, -1)
        normal = np.einsum("nif,njf->fij", pair, pair)
        hidden = np.linalg.eigvalsh(normal)[:, 0] < HIDDEN**2 * len(self.q) / 2
        normal[hidden] = np.eye(2)
        found = np.linalg.solve(normal, np.einsum("nif,nd->fid", pair, left))
        found[hidden] = np.nan
        return np.linalg.norm(found, axis=1)

    def plot(self, *, file: str | os.PathLike[str] | None = None) -> "Figure":
        """Errors along and across the axis over q with the fit, as Figures 4.4 and 4.5; saved to `file` if it is named."""
        from gantrytau_optimica.calibration.error_analysis.guideway_figures import draw_errors

        return draw_errors(self.q, self.error, self.profile, self.noise, file)

    def plot_backlash(self, *, file: str | os.PathLike[str] | None = None) -> "Figure":
        """Errors along the axis for both directions of motion, as Figure 4.3. Raises ModelError if there is only one."""
        from gantrytau_optimica.calibration.error_analysis.guideway_figures import draw_backlash

        if self.backlash is None:
            raise ModelError(
                "plot_backlash: found points from one direction of motion only, expected both; measure forth and back"
            )
        sides = {}
        for side, name in ((1, "with rising q"), (-1, "with falling q")):
            rows = np.flatnonzero(self.rising == side)
            rows = rows[np.argsort(self.q[rows])]
            smooth = self.profile(self.q[rows])[0][:, 0] - side * self.backlash / 2
            sides[name] = self.q[rows], self.along[rows], smooth
        return draw_backlash(sides, self.backlash, self.backlash_error or 0.0, file)

    def __str__(self) -> str:
        micro = 1e6
        lines = [
            f"guideway of {np.ptp(self.q):.3f} m, {len(self.q)} points: error {micro * self.size.mean():.1f} um in the "
            f"mean, {micro * self.size.max():.1f} um at most; straight within {_listed(self.straightness)} um; noise "
            f"{_listed(self.noise)} um ({'along' if len(self.noise) == 1 else 'along, to the side, upwards'})"
        ]
        if self.cyclic is not None:
            parts = zip(self.cyclic.amplitude[:, 0], self.cyclic.amplitude_error[:, 0], strict=True)
            waves = ", ".join(f"{micro * a:.1f} +- {micro * e:.1f} um" for a, e in parts)
            lines.append(
                f"repeating with the pitch of {1e3 * self.cyclic.pitch:.3f} mm along the axis: {waves}"
            )
        if self.backlash is not None and self.backlash_error is not None:
            lines.append(f"backlash {micro * self.backlash:.1f} +- {micro * self.backlash_error:.1f} um")
        return "\n".join([*lines, *map(str, self.findings)])


def linearity(
    q: Any,
    points: Any,
    *,
    pitch: float | None = None,
    harmonics: int = 1,
    rising: Any = None,
    intervals: int | None = None,
    up: Any = (0.0, 0.0, 1.0),
    loss: Literal["linear", "robust"] = "linear",
) -> Linearity:
    """How straight a guideway is and how its drive errs, from points measured along it.

    q: positions of the cart (N,) in m in the order of measuring; points: (N, 3) in m in any frame, or (N,) lengths along
    the axis. pitch: of rack and pinion or screw in m; harmonics: how many of its waves. rising: (N,) 1 where the cart
    came with rising q, -1 with falling; default from the order of q, less than 0.1 mm being no turn. intervals: of the
    cubic splines of the smooth part, default as many as the points allow, at most 12, none as short as three pitches.
    up: which way is up. loss: "linear" fits all points, "robust" leaves out those that do not fit the others; both tell
    which they are.
    Raises ModelError for other shapes, CalibrationError (`.rows`) for data that do not hold what is asked.
    """
    check_words(linearity, locals())
    pitch = None if pitch is None else number("linearity", "pitch", pitch, above=0.0)
    whole("linearity", "harmonics", harmonics, least=1)
    intervals = None if intervals is None else whole("linearity", "intervals", intervals, least=1)
    up = array("linearity", "up", up, (3,))
    given = np.size(q)
    q, points, rows, findings = checked(q, points)
    rising = approach(q, rising, rows, given)
    design = np.column_stack([np.ones(len(q)), q])
    (start, direction), *_ = np.linalg.lstsq(design, points, rcond=None)
    findings += scale_findings(float(np.linalg.norm(direction)), rows)
    basis = basis_of(q, rising, pitch, harmonics, intervals)
    columns = np.column_stack([basis.others(q, rising), basis.waves(q)])
    refuse_hidden(basis, q, rising, rows)
    findings += aliased(q, pitch, rows)
    fits = fitting(columns, points)
    findings += outliers(rows[~fits])
    if loss == "robust":
        (start, direction), *_ = np.linalg.lstsq(design[fits], points[fits], rcond=None)
    axes = axes_along(direction / np.linalg.norm(direction), up)
    error = (points - design @ [start, direction]) @ axes.T
    used = fits if loss == "robust" else slice(None)
    coefficients, covariance, noise = fitted(columns[used], error[used])
    both = basis.both
    smooth = basis.smooth(q).shape[1]
    lash = float(coefficients[smooth, 0]) if both else None
    lash_error = float(np.sqrt(covariance[smooth, smooth]) * noise[0]) if both else None
    first = columns.shape[1] - 2 * harmonics
    cyclic = (
        None if pitch is None else _cyclic(pitch, coefficients[first:], covariance[first:, first:], noise)
    )
    return Linearity(
        q, rising, start, direction, axes, error, noise, cyclic, lash, lash_error, rows, tuple(findings), basis,
        coefficients, covariance,
    )  # fmt: skip


def _cyclic(pitch: float, coefficients: Array, covariance: Array, noise: Array) -> Cyclic:
    """Amplitudes of the waves; their errors are those of the pair of coefficients in its own direction."""
    pairs = coefficients.reshape(-1, 2, coefficients.shape[1])
    amplitude = np.linalg.norm(pairs, axis=1)
    unit = pairs / np.maximum(amplitude, 1e-300)[:, None]
    count = len(pairs)
    blocks = covariance.reshape(count, 2, count, 2)[np.arange(count), :, np.arange(count)]
    error = np.sqrt(np.einsum("hid,hij,hjd->hd", unit, blocks, unit)) * noise
    return Cyclic(pitch, amplitude, error, np.arctan2(pairs[:, 1], pairs[:, 0]))


def _listed(values: Array) -> str:
    return ", ".join(f"{1e6 * v:.1f}" for v in values)
