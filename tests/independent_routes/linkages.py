"""Random chains of joints in space, open or held at their end by a ball joint, and their accelerations in NumPy alone.

Newton and Euler along the chain give M(q), h(q, q'), the Jacobian of the end and what of its acceleration is due to speeds:

    M q'' + h = tau + J' f,    J q'' + a = 0    (f, J and a for a chain that is held)

f is not unique where constraints repeat each other; q'' is.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from gantrytau import Fixed, Model, Start, connect
from gantrytau.mechanics import multibody, rotational, translational
from tests.references.rotations import turn

GRAVITY = np.array([0.0, 0.0, -9.81])  # m/s2
DIRECTIONS = [*np.eye(3), *(-np.eye(3)), np.array([1.0, 1.0, 0.0]), np.array([0.3, -0.5, 0.8])]
TURN, SLIDE = "turn", "slide"


@dataclass(frozen=True, eq=False)
class Linkage:
    """Joints one after another, each with a body and an arm to the next; m, kg, in axes of the body."""

    kinds: tuple[str, ...]
    axes: np.ndarray  # (n, 3) unit vectors
    arms: np.ndarray  # (n, 3)
    masses: np.ndarray  # (n,)
    centres: np.ndarray  # (n, 3)
    inertias: np.ndarray  # (n, 3, 3), about the centres
    start: np.ndarray  # (n,) pose at which the end of a closed one is held
    closed: bool

    @property
    def coordinates(self) -> list[str]:
        """Names of positions in the model."""
        return [f"joint{k}.{'phi' if kind == TURN else 's'}" for k, kind in enumerate(self.kinds)]

    @property
    def speeds(self) -> list[str]:
        """Names of speeds."""
        return [f"joint{k}.{'w' if kind == TURN else 'v'}" for k, kind in enumerate(self.kinds)]

    @property
    def drives(self) -> list[str]:
        """Names of the torques and forces in the joints."""
        return [f"drive{k}.{'tau' if kind == TURN else 'f'}" for k, kind in enumerate(self.kinds)]


def random_linkage(rng: np.random.Generator) -> Linkage:
    """Axes along the world's or askew, arms that may be zero, poses at quarter turns, masses of any size."""
    closed = bool(rng.integers(2))
    planar = closed and bool(rng.integers(2))
    n = 3 if planar else int(rng.integers(4, 6)) if closed else int(rng.integers(1, 5))
    kinds = [TURN if planar or rng.random() < 0.8 else SLIDE for _ in range(n)]
    chosen = [DIRECTIONS[int(k)] for k in rng.integers(0, len(DIRECTIONS), n)]
    axes = np.array([chosen[0] if planar else axis for axis in chosen])
    axes = axes / np.linalg.norm(axes, axis=1)[:, None]
    arms = rng.choice([0.0, 0.3, 0.5, -0.4], (n, 3))
    arms[~arms.any(axis=1), 0] = 0.4
    size = float(rng.choice([1.0, 1.0, 1e-12, 6e24]))
    halves = rng.normal(size=(n, 3, 3)) * 0.2
    spread = halves @ halves.transpose(0, 2, 1) * float(rng.integers(2))  # of the mass in space
    return Linkage(
        kinds=tuple(kinds),
        axes=axes,
        arms=arms,
        masses=size * rng.choice([1.0, 0.5, 2.0], n),
        centres=rng.choice([0.0, 0.1, -0.2], (n, 3)),
        inertias=size
        * (np.array([np.trace(s) * np.eye(3) - s for s in spread]) + np.diag([0.02, 0.03, 0.04])),
        start=random_pose(rng, n),
        closed=closed,
    )


def random_pose(rng: np.random.Generator, n: int) -> np.ndarray:
    """Quarter turns, or anything."""
    return np.where(rng.random(n) < 0.6, rng.integers(-2, 3, n) * np.pi / 2, rng.uniform(-2.0, 2.0, n))


def model_of(linkage: Linkage, q: np.ndarray, v: np.ndarray) -> Model:
    """The model, which starts with positions q and speeds v."""
    end = motion(linkage, linkage.start, 0 * linkage.start)
    begin = Start if linkage.closed else Fixed  # consistent values are kept as they are
    members: dict[str, Any] = {"world": multibody.World()}
    wires: list[tuple[str, str]] = []
    before = "world.frame_b"
    for k, kind in enumerate(linkage.kinds):
        axis = linkage.axes[k].tolist()
        start = (
            {"phi": begin(q[k]), "w": begin(v[k])} if kind == TURN else {"s": begin(q[k]), "v": begin(v[k])}
        )
        members[f"joint{k}"] = (multibody.Revolute if kind == TURN else multibody.Prismatic)(n=axis, **start)
        members[f"drive{k}"] = rotational.Torque() if kind == TURN else translational.Force()
        members[f"body{k}"] = multibody.Body(
            m=linkage.masses[k], r_cm=linkage.centres[k].tolist(), J=linkage.inertias[k].tolist()
        )
        members[f"arm{k}"] = multibody.FixedTranslation(r=linkage.arms[k].tolist())
        wires += [
            (before, f"joint{k}.frame_a"),
            (f"joint{k}.frame_b", f"body{k}.frame_a"),
            (f"joint{k}.frame_b", f"arm{k}.frame_a"),
            (f"drive{k}.flange", f"joint{k}.axis"),
        ]
        before = f"arm{k}.frame_b"
    if linkage.closed:
        members["anchor"] = multibody.Fixed(r=end.place.tolist())
        members["ball"] = multibody.Spherical()
        wires += [("anchor.frame_b", "ball.frame_a"), ("ball.frame_b", before)]

    def equations(self: Any) -> Any:
        for a, b in wires:
            yield connect(_reached(self, a), _reached(self, b))

    return type("Random", (Model,), {**members, "equations": equations})()


def _reached(model: Any, path: str) -> Any:
    for name in path.split("."):
        model = getattr(model, name)
    return model


@dataclass(frozen=True, eq=False)
class Motion:
    """Of a chain at q and q': M (n, n), h (n,), the end's place (3,), its Jacobian (3, n), its acceleration for q'' = 0."""

    mass: np.ndarray
    forces: np.ndarray
    place: np.ndarray
    jacobian: np.ndarray
    drift: np.ndarray


def motion(linkage: Linkage, q: np.ndarray, v: np.ndarray) -> Motion:
    """Along the chain, all in world axes."""
    n = len(q)
    R, r = np.eye(3), np.zeros(3)
    w, alpha, a = np.zeros(3), np.zeros(3), np.zeros(3)
    Jw, Jr = np.zeros((3, n)), np.zeros((3, n))
    mass, forces = np.zeros((n, n)), np.zeros(n)

    def moved(
        arm: np.ndarray, acceleration: np.ndarray, jacobian: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Acceleration and Jacobian of a point that turns with the body, an arm away."""
        turned = np.cross(alpha, arm) + np.cross(w, np.cross(w, arm))
        return acceleration + turned, jacobian + np.cross(Jw.T, arm).T

    for k, kind in enumerate(linkage.kinds):
        e = R @ linkage.axes[k]
        if kind == TURN:
            alpha = alpha + np.cross(w, e) * v[k]
            w = w + e * v[k]
            Jw = Jw.copy()
            Jw[:, k] += e
            R = R @ turn(linkage.axes[k] * q[k])
        else:
            a, Jr = moved(e * q[k], a, Jr)
            a = a + 2 * np.cross(w, e) * v[k]
            Jr[:, k] += e
            r = r + e * q[k]
        centre, inertia = R @ linkage.centres[k], R @ linkage.inertias[k] @ R.T
        there, Jc = moved(centre, a, Jr)
        mass += linkage.masses[k] * Jc.T @ Jc + Jw.T @ inertia @ Jw
        forces += linkage.masses[k] * Jc.T @ (there - GRAVITY)
        forces += Jw.T @ (inertia @ alpha + np.cross(w, inertia @ w))
        arm = R @ linkage.arms[k]
        a, Jr = moved(arm, a, Jr)
        r = r + arm
    return Motion(mass, forces, r, Jr, a)


def accelerations(linkage: Linkage, q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """q'' in joint coordinates, from the equations above."""
    found = motion(linkage, q, v)
    n, size = len(q), np.abs(found.mass).max()
    if not linkage.closed:
        return np.linalg.solve(found.mass / size, (tau - found.forces) / size)
    J = found.jacobian
    matrix = np.block([[found.mass / size, J.T], [J, np.zeros((3, 3))]])
    right = np.concatenate([(tau - found.forces) / size, -found.drift])
    return np.linalg.lstsq(matrix, right, rcond=1e-10)[0][:n]


def led(
    linkage: Linkage, independent: list[int], change: np.ndarray, rates: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Positions and speeds of a closed chain once its independent joints have moved; None near singular poses."""
    anchor = motion(linkage, linkage.start, 0 * linkage.start).place
    q, others = linkage.start.copy(), [k for k in range(len(linkage.kinds)) if k not in independent]
    steps = 200
    for _ in range(steps + 1):
        J = motion(linkage, q, 0 * q).jacobian
        values = np.linalg.svd(J[:, others], compute_uv=False)
        if np.linalg.matrix_rank(J, 1e-6) != np.sum(values > 0.05):
            return None
        q[independent] += change / (steps + 1)
        for _ in range(8):
            now = motion(linkage, q, 0 * q)
            q[others] -= np.linalg.lstsq(now.jacobian[:, others], now.place - anchor, rcond=1e-6)[0]
    J = motion(linkage, q, 0 * q).jacobian
    v = np.zeros(len(q))
    v[independent] = rates
    v[others] = -np.linalg.lstsq(J[:, others], J[:, independent] @ rates, rcond=1e-6)[0]
    fits = np.abs(motion(linkage, q, 0 * q).place - anchor).max() < 1e-12 and np.abs(J @ v).max() < 1e-12
    return (q, v) if fits else None
