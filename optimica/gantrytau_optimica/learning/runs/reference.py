"""Motions of a tool that are run again and again: way points over samples, from rest."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import array, number, whole
from gantrytau.border.refusal import Given
from gantrytau.describing.record import Record

STILL = 1e-9  # m, by which the first two samples may differ
EVEN = 1e-6  # of the period, by which times may be off


@dataclass(frozen=True, eq=False, repr=False)
class Reference(Record):
    """Positions of the tool r (N, 3) in m at times t (N,) in s, evenly spaced, from rest.

    Raises ModelError for shapes that do not fit, what is not finite, uneven times, and a motion that does not begin at rest:
    a robot that is started in motion does not repeat itself.
    """

    t: Any
    r: Any

    def __post_init__(self):
        for name, columns in (("t", 0), ("r", 3)):
            shape = (None, columns) if columns else (None,)
            found = array("Reference", name, getattr(self, name), shape)
            if len(found) < 3:
                raise ModelError(
                    f"found {len(found)} rows of {name}, expected 3 at least",
                    place="Reference",
                    argument=name,
                )
            found.flags.writeable = False
            object.__setattr__(self, name, found)
        if len(self.t) != len(self.r):
            raise ModelError(
                f"Reference: found {len(self.t)} times and {len(self.r)} positions, expected as many"
            )
        steps = np.diff(self.t)
        if not np.all(np.abs(steps - self.period) <= EVEN * self.period) or self.period <= 0:
            raise ModelError("Reference: found uneven times, expected one period throughout", argument="t")
        moved = float(np.linalg.norm(self.r[1] - self.r[0]))
        if moved > STILL:
            raise ModelError(
                f"Reference: found a start in motion, {moved / self.period:.3g} m/s, expected rest; begin with "
                "samples at the first position",
                argument="r",
            )

    @property
    def period(self) -> float:
        """Distance of samples in s."""
        return float((self.t[-1] - self.t[0]) / (len(self.t) - 1))

    @property
    def moving(self) -> tuple[int, ...]:
        """Axes in which it moves, of 0, 1 and 2."""
        return tuple(int(k) for k in np.flatnonzero(np.ptp(self.r, axis=0) > STILL))

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        return f"<Reference: {len(self)} samples every {self.period:g} s, within {np.ptp(self.r, axis=0)} m>"


def square_reference(
    size: float = 0.01,
    *,
    start: tuple[float, float, float] = (0.9, 2.7, -0.7),
    move: float = 0.22,
    edge: float = 0.412,
    rounds: int = 2,
    begin: float = 1.2,
    duration: float = 4.8,
    period: float = 0.004,
) -> Reference:
    """A square in the plane of x and y, in negative y first, with a stop in each corner: Dressler (2012), Figure 7.4.

    size: m, of an edge; start: m; move: s of motion along an edge, with a speed like sin^2, whose peak is 2 size / move;
    edge: s of motion and stop; begin: s of rest before; duration: s. Raises ModelError for times that do not fit.
    """
    given = dict(size=size, move=move, edge=edge, begin=begin, duration=duration, period=period)
    size, move, edge, begin, duration, period = (
        number("square_reference", name, value, above=0.0) for name, value in given.items()
    )
    whole("square_reference", "rounds", rounds, least=1)
    move = number("square_reference", "move", move, most=edge)
    begin = number("square_reference", "begin", begin, least=2 * period)
    if begin + 4 * rounds * edge > duration + period:
        raise ModelError(
            f"expected {begin + 4 * rounds * edge:g} s at least: {begin:g} s of rest and {4 * rounds} edges of {edge:g} s",
            place="square_reference",
            found=Given("duration", duration),
        )
    t = period * np.arange(round(duration / period))
    r = np.tile(np.asarray(start, dtype=float), (len(t), 1))
    for k in range(4 * rounds):
        share = np.clip((t - begin - k * edge) / move, 0.0, 1.0)
        along = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]][k % 4])
        r += size * np.outer(share - np.sin(2 * np.pi * share) / (2 * np.pi), along)
    return Reference(t, r)
