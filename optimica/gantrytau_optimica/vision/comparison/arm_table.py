"""Numbers of arms by one device beside those by another, in one frame: Tables 5.6 and 5.7 of the thesis."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import one_of
from gantrytau.describing.record import Record
from gantrytau_optimica.calibration.calibration import Calibration
from gantrytau_optimica.vision.comparison.compare import Comparison
from gantrytau_optimica.vision.comparison.printed_tables import ARMS

Array = np.ndarray
PARTS = ("length", "offset", "direction")


@dataclass(frozen=True, eq=False)
class ArmTable(Record):
    """Numbers of arms, (arms, 7): length in m, offset (3) in m, direction (3), one array for each name."""

    arms: Mapping[str, Array]

    @classmethod
    def printed(cls, table: str) -> "ArmTable":
        """Table "5.6" (cameras, laser) or "5.7" (tape measure, one camera) of the thesis; ModelError for another."""
        one_of("ArmTable.printed", "table", table, ARMS)
        return cls({name: np.array([[L, *A, *v] for L, A, v in arms]) for name, arms in ARMS[table].items()})

    def difference(self, one: str, other: str) -> Array:
        """Numbers of one less those of another, (arms, 7); ModelError for names that it has not."""
        one_of("ArmTable.difference", "one", one, self.arms)
        one_of("ArmTable.difference", "other", other, self.arms)
        return self.arms[one] - self.arms[other]

    def __str__(self) -> str:
        lines = [f"{'':24}{'L [m]':>10}  {'A [m]':^28}  {'v [1]':^26}"]
        for k in range(len(next(iter(self.arms.values())))):
            for name, numbers in self.arms.items():
                L, *others = numbers[k]
                A, v = others[:3], others[3:]
                words = f"arm {k + 1}, {name}"
                offset = "  ".join(f"{x:8.4f}" for x in A)
                along = "  ".join(f"{x:8.4f}" for x in v)
                lines.append(f"{words:24}{L:10.4f}  {offset}  {along}")
        return "\n".join(lines)


def arm_table(found: Mapping[str, Calibration], frames: Mapping[str, Comparison] | None = None) -> ArmTable:
    """The numbers that calibrations found, arm by arm, in one frame.

        arm_table({"cameras": a, "laser": b}, {"cameras": compare(poses.r, laser)})

    found: calibrations of robots whose arms have one length, offset and direction each (three links, or model=1); frames:
    the motion from the frame of a calibration's measurements to that of the table, by name, as `compare` found it; where it
    is left out, that of the measurements. Raises ModelError for other robots and frames of names that are not there.
    """
    frames = frames or {}
    unknown = [name for name in frames if name not in found]
    if unknown or not found:
        known, wrong = ", ".join(found) or "calibrations", ", ".join(unknown) or "nothing"
        raise ModelError(f"arm_table: found frames of {wrong}, expected those of {known}")
    return ArmTable({name: _moved(_numbers(name, each), frames.get(name)) for name, each in found.items()})


def _numbers(name: str, calibration: Calibration) -> Array:
    parameters: Mapping[str, Any] = calibration.parameters
    rows: list[Sequence[float]] = []
    k = 0
    while f"arms[{k}].length" in parameters:
        rows.append([float(x) for part in PARTS for x in np.ravel(parameters[f"arms[{k}].{part}"])])
        k += 1
    if not rows:
        raise ModelError(
            f"arm_table: found {name!r} without arms[0].length, expected arms of one length each; calibrate "
            "six links with model=1"
        )
    return np.array(rows)


def _moved(arms: Array, frame: Comparison | None) -> Array:
    if frame is None:
        return arms
    length, offset, along = arms[:, :1], arms[:, 1:4], arms[:, 4:]
    turned = offset @ frame.R.T * frame.scale + frame.t
    return np.hstack([frame.scale * length, turned, frame.scale * along @ frame.R.T])
