"""Mass, centre and inertia of shapes of a density, as a body has them that states its shapes only."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gantrytau.border.refusal import ModelError


@dataclass(frozen=True)
class Lump:
    """m: kg, or m3 for the density 1; r: (3,), its centre; J: (3, 3) about its centre, both in the frame of a link."""

    m: float
    r: np.ndarray
    J: np.ndarray

    def times(self, density: float) -> "Lump":
        """The same shape of another density."""
        return Lump(self.m * density, self.r, self.J * density)

    def placed(self, r: np.ndarray, R: np.ndarray) -> "Lump":
        """The same seen from a frame in which its own one stands at r, turned by R."""
        return Lump(self.m, r + R @ self.r, R @ self.J @ R.T)


def joined(lumps: list[Lump]) -> Lump:
    """Several as one rigid body."""
    m = sum(lump.m for lump in lumps)
    centre = sum((lump.m * lump.r for lump in lumps), np.zeros(3)) / m
    arms = [lump.r - centre for lump in lumps]
    steiner = [lump.m * (a @ a * np.eye(3) - np.outer(a, a)) for lump, a in zip(lumps, arms, strict=True)]
    return Lump(m, centre, sum((lump.J for lump in lumps), np.zeros((3, 3))) + sum(steiner))


def cuboid(half: tuple[float, ...]) -> Lump:
    """half: half the lengths of its edges, (3,) in m."""
    return _ellipsoidal(8 * math.prod(half), half, 3)


def ellipsoid(half: tuple[float, ...]) -> Lump:
    """half: its semi-axes, (3,) in m."""
    return _ellipsoidal(4 / 3 * math.pi * math.prod(half), half, 5)


def cylinder(radius: float, half: float) -> Lump:
    """A cylinder along z, half its length in m."""
    m = 2 * np.pi * radius**2 * half
    across = m * (radius**2 / 4 + half**2 / 3)
    return Lump(m, np.zeros(3), np.diag([across, across, m * radius**2 / 2]))


def capsule(radius: float, half: float) -> Lump:
    """A cylinder along z, half its length in m, with a half of a ball on each end."""
    bar, ball = cylinder(radius, half), ellipsoid((radius,) * 3)
    # a half of a ball has its centre 3/8 of the radius above its base
    across = bar.J[0, 0] + ball.J[0, 0] + ball.m * (half**2 + 3 / 4 * half * radius)
    return Lump(bar.m + ball.m, np.zeros(3), np.diag([across, across, bar.J[2, 2] + ball.J[2, 2]]))


def mesh_lump(file: Path, scale: tuple[float, ...]) -> Lump:
    """A closed mesh by the integrals of trimesh; scale: m for a unit of the file, along its axes."""
    try:
        import trimesh
    except ImportError:
        raise ModelError(
            f"{file}: found no trimesh, which integrates meshes, expected it installed; pip install 'gantrytau[view]'",
            argument="file",
        ) from None
    try:
        mesh = trimesh.load_mesh(str(file))
        mesh.apply_transform(np.diag([*scale, 1.0]))
        closed = mesh.is_watertight and mesh.volume > 0
    except Exception as error:  # each format has a reader of its own, with errors of its own
        raise ModelError(
            f"{file}: found no mesh ({error}), expected STL, OBJ, PLY or GLB", argument="file"
        ) from None
    if not closed:
        raise ModelError(
            f"{file}: found a mesh that is not closed, expected one that has a volume; state mass and inertia of its body",
            argument="file",
        )
    return Lump(float(mesh.volume), np.array(mesh.center_mass), np.array(mesh.moment_inertia))


def _ellipsoidal(m: float, half: tuple[float, ...], divisor: int) -> Lump:
    x, y, z = np.square(half)
    return Lump(m, np.zeros(3), np.diag([y + z, x + z, x + y]) * m / divisor)
