"""Causes of large residuals, as messages: changes over the rows, priors and limits, a scale."""

from collections.abc import Iterator

import numpy as np

from gantrytau_optimica.calibration.data.row_sets import rows_of
from gantrytau_optimica.calibration.diagnostics.constraint_tension import pulls
from gantrytau_optimica.calibration.diagnostics.fitted_rods import FittedRods
from gantrytau_optimica.calibration.diagnostics.outliers import OUTLIER
from gantrytau_optimica.calibration.diagnostics.row_effects import RowEffect, row_effects
from gantrytau_optimica.fitting.finding import DataRows, Finding, length_text

SHOWN = 3  # priors or constraints that are named
UNIT = 1e-9  # by which a direction of length 1 may be rounded
ALIKE = 4.0  # deviations by which scales of guideways may differ and be one
LOOKED_AT = 1000  # poses, in which a slip or a drift is looked for
ADVICE = {
    "drift": "the device or the robot warmed up, settled or gave way; wait until they stand, and measure again, the first "
    "poses once more at the end",
    "jump": "the device or the robot was moved; calibrate the parts apart, or measure again",
    "period": "look how they were measured or written down, and leave them out, or measure again",
    "slip": "the encoder slipped or was referenced anew, or the robot or the device was moved; calibrate the parts apart, "
    "or measure again",
}
ALIKE_ORDER = (
    "; as rows follow the places of the tool, an error of the model may look the same: a mixed order tells"
)
ORDINALS = ("", "", "second", "third", "fourth", "fifth", "sixth")


def over_rows(found: FittedRods) -> Iterator[Finding]:
    """Changes over the rows: from one row on, with the order of the rows, or from row to row."""
    if found.measurements.shared is not None:  # such errors follow the order of the places
        return
    used, systems = found.systems(LOOKED_AT)
    rows = rows_of(found.rows, found.held_out, without=found.left_out)
    for effect in row_effects(systems, found.measurements.r[used], used):
        off = effect.rows
        first, last = used[off[0]], used[off[-1] + 1] if off[-1] + 1 < len(used) else len(found.measurements)
        if effect.kind == "period":
            here = rows[(rows - first) % effect.period == 0]
        else:
            here = rows[(rows >= first) & (rows < last)]
        yield _of_rows(found, effect, here)


def _of_rows(found: FittedRods, effect: RowEffect, rows: np.ndarray) -> Finding:
    """The finding on an effect in some rows, of all that take part."""
    angle = effect.kind == "turn" or (effect.column >= len(found.nominal_rods.arms))
    unit, where = "mrad" if angle else "mm", DataRows(rows, len(found.measurements))
    off = f"{effect.change[0] * 1e3:+.3g} {unit}"  # of an actuator
    size = f"{effect.size * 1e3:.3g} {unit} ({', '.join(f'{x * 1e3:+.3g}' for x in effect.change)} {unit})"
    every = f"every {ORDINALS[effect.period]} row, " if effect.period else ""
    kind, before, after = {
        "position": ("drift", f"positions drift by {size} from the first of ", " to the last"),
        "turn": ("drift", f"the frame of positions turns by {size} from the first of ", " to the last"),
        "actuator": ("drift", f"q{effect.column + 1} drifts by {off} from the first of ", " to the last"),
        "jump": ("jump", f"positions lie off by {size} in ", ", beside the other rows"),
        "period": ("period", f"positions lie off by {size} in {every}", ", beside the other rows"),
        "slip": ("slip", f"q{effect.column + 1} is off by {off} in ", ", beside the other rows"),
    }[effect.kind]
    left = f"; without it {length_text(np.sqrt(effect.variance))} are left of the links; {ADVICE[kind]}"
    return Finding(kind, rows, (before, where, after, left, ALIKE_ORDER if effect.alike else ""))


def pulled(found: FittedRods) -> Iterator[Finding]:
    """Priors and constraints that data contradict, and limits that are reached."""
    each = [pull for fit in found.fits for pull in pulls(fit, found.constraints)]
    for kind, told, advice in (
        (
            "prior",
            "data want {name} at {wanted:.7g}, the prior {held:.7g} +- {deviation:.3g} holds it {far} deviations off",
            "look at its value, or give it a larger deviation",
        ),
        (
            "equation",
            "data want {name} at {wanted:.7g}, a constraint holds it at {held:.7g}, {far} deviations off",
            "look at its value, or leave it free",
        ),
        (
            "limit",
            "{name} stands at its limit {held:.7g}, data want {wanted:.7g}, {far} deviations beyond",
            "widen the limit, or look whether measurements and units are right",
        ),
    ):
        those = [pull for pull in each if pull.kind == kind]
        if those:
            shown = "; ".join(
                told.format(**vars(pull), far=f"{pull.deviations:.3g}") for pull in those[:SHOWN]
            )
            more = f"; and {len(those) - SHOWN} more" if len(those) > SHOWN else ""
            yield Finding(kind, found.rows, f"{shown}{more}; the other numbers are pulled along; {advice}")


def scaled(found: FittedRods) -> Iterator[Finding]:
    """Guideways along which all carts go farther, or less far, than they say, by the same share.

    Closure is the same if all lengths grow alike, directions of guideways too. Where the model has these of length 1, so
    that q counts metres, they are a measure.
    """
    names = [arm.direction for arm in found.nominal_rods.arms]
    known = [name for name in names if f"{name}[0]" in found.names and not found.undetermined_part(name)]
    if len(known) < max(2, len(names)):
        return
    nominal = [np.linalg.norm(found.nominal_rods.values[name]) for name in names]
    if np.abs(np.array(nominal) - 1.0).max() > UNIT:
        return
    vectors = [found.parameters[name] for name in names]
    grown = np.array([np.linalg.norm(v) for v in vectors]) - 1.0
    deviations = np.array(
        [
            np.sqrt(v @ found.covariance([name]) @ v) / np.linalg.norm(v)
            for name, v in zip(names, vectors, strict=True)
        ]
    )
    weights = 1 / np.maximum(deviations, 1e-12) ** 2
    mean, deviation = weights @ grown / weights.sum(), 1 / np.sqrt(weights.sum())
    if abs(mean) > OUTLIER * deviation and np.abs((grown - mean) / deviations).max() < ALIKE:
        words = (
            f"all guideways are {1 + mean:.7g} m long for each metre of q, {abs(mean) / deviation:.3g} deviations off 1; "
            "lengths, offsets and positions are larger by the same factor; look at the scale of the device (temperature, "
            "refraction) and of the carts, and divide by it what is wrong"
        )
        yield Finding("scale", found.rows, words)
