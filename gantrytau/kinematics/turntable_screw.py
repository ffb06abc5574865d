"""Ball screws that turn turntables: between angles of motors and angles of turntables, both ways, with slopes.

A spindle hangs in a pivot P on what carries the turntable, its nut in a pivot Q on the turntable, both across the axis O:

    l(phi)^2 = OP^2 + OQ^2 - 2 OP OQ cos(angle + phi)          law of cosines
    theta    = 2 pi (l(phi) - l(0)) / lead                     angle of the motor
    theta'   = 2 pi h / lead,    h = OP OQ sin(angle + phi) / l = l'         h: distance of the spindle from the axis

The thesis says that motors turn the turntables q4 to q6 of the F1 (section 4.5), and prints no numbers of their drives.
`gears.ScrewLever` is the same as a component.
"""

import math
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from gantrytau.border.checks import array, number
from gantrytau.border.refusal import Given, ModelError

FLAT = 1e-6  # of OP and OQ: how far pivots may be from one plane across the axis


@dataclass(frozen=True, kw_only=True)
class TurntableScrew:
    """A ball screw between a pivot on what carries a turntable and one on the turntable, free of play.

    base: OP, crank: OQ, distances of the pivots of spindle and nut from the axis, m; angle: from OP to OQ about the axis
    with the turntable at 0, between 0 and pi or between -pi and 0, rad; lead: lengthening of the screw by a turn of the
    motor, m, negative for a shortening. All methods take numbers or arrays and return the same shape. Values are NaN beyond
    the dead centres, in which screw and axis are in line and the motor cannot turn the table. Raises ModelError for
    impossible dimensions.
    """

    base: float
    crank: float
    angle: float
    lead: float

    def __post_init__(self):
        kind = type(self).__name__
        for name, unit, limits in (
            ("base", "m", dict(above=0.0)),
            ("crank", "m", dict(above=0.0)),
            ("angle", "rad", dict(above=-math.pi, below=math.pi)),
            ("lead", "m", {}),
        ):
            found = number(kind, name, getattr(self, name), unit=unit, **limits)
            if found == 0:
                raise ModelError("expected another number than 0", place=kind, found=Given(name, found))
            object.__setattr__(self, name, found)

    @classmethod
    def of_places(cls, *, axis: ArrayLike, base: ArrayLike, nut: ArrayLike, lead: float) -> Self:
        """The screw of pivots at places (3,) in m, in axes whose origin is on the axis (3,) of the turntable, which is at 0.

        Raises ModelError for wrong shapes, pivots on the axis, and pivots not in one plane across it: that screw would swing
        out of its plane.
        """
        given = {"axis": axis, "base": base, "nut": nut}
        way, start, end = (array("TurntableScrew.of_places", name, one, (3,)) for name, one in given.items())
        size = np.linalg.norm(way)
        if size == 0:
            raise ModelError(
                "TurntableScrew.of_places: found an axis of length 0, expected a direction", argument="axis"
            )
        n = way / size
        out_of_plane = abs(float(n @ (end - start)))
        start, end = start - n * (n @ start), end - n * (n @ end)
        if out_of_plane > FLAT * max(np.linalg.norm(start), np.linalg.norm(end)):
            raise ModelError(
                f"TurntableScrew.of_places: found pivots {out_of_plane:.3g} m apart along the axis, expected them in one "
                "plane across it; move one of them",
                argument="nut",
            )
        angle = math.atan2(float(n @ np.cross(start, end)), float(start @ end))
        return cls(
            base=float(np.linalg.norm(start)), crank=float(np.linalg.norm(end)), angle=angle, lead=lead
        )

    @property
    def range(self) -> tuple[float, float]:
        """The angles of the turntable at the dead centres, rad; it turns between them."""
        return (-self.angle, math.pi - self.angle) if self.angle > 0 else (-math.pi - self.angle, -self.angle)

    def length(self, phi: Any) -> np.ndarray:
        """From pivot to pivot with the turntable at phi, m."""
        return self._length(self._opening(phi))

    def motor(self, phi: Any) -> np.ndarray:
        """The angle of the motor with the turntable at phi, rad; 0 with it at 0."""
        # a difference of squares, so that small angles keep their digits
        opening = self._opening(phi)
        half = 2 * np.sin((opening + self.angle) / 2) * np.sin((opening - self.angle) / 2)
        longer = 2 * self.base * self.crank * half / (self._length(opening) + self._length(self.angle))
        return 2 * math.pi / self.lead * longer

    def turntable(self, theta: Any) -> np.ndarray:
        """The angle of the turntable with the motor at theta, rad; NaN for lengths that the screw cannot have."""
        theta = array("TurntableScrew", "theta", theta, unit="rad", finite=False)
        length = self._length(self.angle) + theta * self.lead / (2 * math.pi)
        with np.errstate(invalid="ignore"):
            # half angles keep their digits near both dead centres
            far = (self.base + self.crank) ** 2 - length**2
            near = length**2 - (self.base - self.crank) ** 2
            opening = 2 * np.arctan2(np.sqrt(near), np.sqrt(far))
            opening = np.where((length > 0) & (near > 0) & (far > 0), opening, np.nan)
        return (math.copysign(1.0, self.angle) * opening - self.angle)[()]

    def lever(self, phi: Any) -> np.ndarray:
        """Lever arm h of the screw force about the axis, m; its sign is that of `angle`."""
        opening = self._opening(phi)
        return self.base * self.crank * np.sin(opening) / self._length(opening)

    def ratio(self, phi: Any) -> np.ndarray:
        """Gear ratio at phi, d theta / d phi: motor speed by turntable speed, turntable torque by motor torque."""
        return 2 * math.pi / self.lead * self.lever(phi)

    def ratio_slope(self, phi: Any) -> np.ndarray:
        """The derivative of `ratio` by phi, 1/rad: der(w of the motor) = ratio der(w) + ratio_slope w^2."""
        opening = self._opening(phi)
        length = self._length(opening)
        lever = self.base * self.crank * np.sin(opening) / length
        return 2 * math.pi / self.lead * (self.base * self.crank * np.cos(opening) - lever**2) / length

    def _opening(self, phi: Any) -> np.ndarray:
        """The angle from OP to OQ; NaN at the dead centres and beyond."""
        found = array("TurntableScrew", "phi", phi, unit="rad", finite=False)
        least, most = self.range
        with np.errstate(invalid="ignore"):
            return np.where((found > least) & (found < most), self.angle + found, np.nan)[()]

    def _length(self, opening: Any) -> Any:
        # |OP - OQ|^2 + 4 OP OQ sin^2: no difference of large numbers where the pivots are near each other
        return np.sqrt(
            (self.base - self.crank) ** 2 + 4 * self.base * self.crank * np.sin(np.asarray(opening) / 2) ** 2
        )
