"""The workspace on a grid that is made finer until its size no longer depends on it."""

from dataclasses import dataclass

import numpy as np

from gantrytau.describing.record import Record
from gantrytau.kinematics import Limits, Workspace, workspace
from gantrytau_optimica.calibration.devices.devices import Device
from gantrytau_optimica.procedure.robot_samples import Fleet

SETTLED = 0.02  # of the volume, and of that part of it which the device sees
FINER = 1.5  # times more cells along each axis in each round
LOOK = 1.0  # m, spacing of a grid of which only the box around it is wanted
COARSE = 10  # cells along the longest side at first
MOST = {"three links": 300_000, "six links": 200_000, "turntables": 120_000}  # places, some seconds of work


@dataclass(frozen=True, eq=False)
class SettledWorkspace(Record):
    """The workspace of the nominal robot: volume and its uncertainty in m3, on a grid of `spacing` (m).

    visible: volume of that part in which the device sees the target, m3; settled: whether a finer grid would hardly change
    them; spacings, volumes, visibles: of all rounds. r, R, q: the places inside, on the grid; box: (3, 2) in m.
    """

    spacing: float
    volume: float
    uncertainty: float
    visible: float
    settled: bool
    spacings: np.ndarray
    volumes: np.ndarray
    visibles: np.ndarray
    box: np.ndarray
    r: np.ndarray
    R: np.ndarray
    q: np.ndarray

    def __str__(self) -> str:
        state = "" if self.settled else ", not settled: a finer grid may change it"
        return (
            f"{self.volume:.4g} m3 +- {self.uncertainty:.2g}, {self.share:.0%} of it visible, on a grid of "
            f"{self.spacing * 1e3:.3g} mm ({len(self.r)} places){state}"
        )

    @property
    def share(self) -> float:
        """The part of the volume that the device sees, 0 to 1."""
        return self.visible / self.volume if self.volume else 0.0

    def drawn(self, robot: object, limits: Limits) -> Workspace:
        """The grid with the limits that are broken at each place, as `gantrytau.kinematics.workspace` gives it."""
        return workspace(robot, limits, spacing=self.spacing, box=self.box)  # type: ignore[arg-type]


def settled_workspace(
    fleet: Fleet, limits: Limits, device: Device, spacing: float | None
) -> SettledWorkspace:
    """The workspace with a spacing (m) at which it has settled, or with the one that is given."""
    member = fleet.nominal
    box = workspace(member.kinematics, limits, spacing=LOOK).box
    step = spacing or float((box[:, 1] - box[:, 0]).max() / COARSE)
    rounds: list[tuple[float, float, float]] = []
    settled, most = False, MOST[fleet.kind]
    while True:
        found = workspace(member.kinematics, limits, spacing=step, box=box)
        inside = found.examined.inside
        at = (each[inside] for each in (found.examined.q, found.examined.r, found.examined.R))
        seen = member.seen(device, *at)
        rounds.append((step, found.volume, found.volume * float(seen.mean()) if seen.size else 0.0))
        settled = len(rounds) > 1 and _alike(rounds[-1][1:], rounds[-2][1:], found.uncertainty)
        if spacing or settled or found.reason.size * FINER**3 > most:
            break
        step /= FINER
    spacings, volumes, visibles = np.array(rounds).T
    return SettledWorkspace(
        spacing=float(spacings[-1]),
        volume=float(volumes[-1]),
        uncertainty=float(found.uncertainty),
        visible=float(visibles[-1]),
        settled=bool(settled),
        spacings=spacings,
        volumes=volumes,
        visibles=visibles,
        box=box,
        r=found.examined.r[inside],
        R=found.examined.R[inside],
        q=found.examined.q[inside],
    )


def _alike(new: tuple[float, ...], old: tuple[float, ...], uncertainty: float) -> bool:
    """Whether two rounds agree, and the grid itself leaves no more doubt."""
    size = max(new[0], 1e-12)
    return uncertainty < SETTLED * size and all(
        abs(a - b) < SETTLED * size for a, b in zip(new, old, strict=True)
    )
