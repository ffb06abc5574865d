"""Errors of orientation over the workspace, and whether links or guideways cause them: Dressler (2012), Figure 4.7.

A plate on parallel links of equal length keeps its orientation. If it does not, there are two ways to find out why.

By layers: a robot on straight parallel guideways does the same at every place along them, so what links and joints cause
depends on where the tool is across the guideways only, and what changes along them is the guideways' doing. This needs
no model, but calls a part of what bent guideways do an error of links.

By closure: at each pose the distance of the joints of link j misses its length by

    c_j = dL_j - (R.T u_j) . db_j + u_j . da_j + u_j . (d_i(q_i) + w_i(q_i) x a_j)

with the unit vector u_j from cart to plate. Errors of lengths dL, of joints db on the plate and da on the cart are
constant; shifts d and turns w of cart i follow its guideway. The pose answers by (dr, turn) = J c with the inverse J of
the matrix of rows (u_j, (R b_j) x u_j) (4.31), so each part of c has its part in the orientation.
"""

import os
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.polynomial.legendre import legvander

from gantrytau import Model
from gantrytau.border.checks import array, whole
from gantrytau.border.refusal import Given, ModelError
from gantrytau.describing.record import Record
from gantrytau.kinematics import Kinematics
from gantrytau.kinematics.poses import poses, vectors
from gantrytau.kinematics.rods.rod_geometry import RodGeometry
from gantrytau.kinematics.rotations import mean_rotation, rotation_vector
from gantrytau_optimica.calibration.data.findings import CalibrationError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = np.ndarray
SINGULAR = np.radians(1.0)  # beta of ZYZ angles below which alpha and gamma are hardly told apart
SPARE = 1.5  # measured numbers for each unknown, at the least
# Singular value by the largest, below which a direction of the unknowns has no influence. Joints on plate and cart can
# be told apart only by how much the plate turns, mostly less than 0.01 rad; less than 0.001 rad is noise magnified.
SMALLEST = 1e-3
LAYERS = 0.1  # of the extent across the guideways: poses that move less along them are in one layer
SURE = 0.01  # probability of chance, below which guideways are held to have a part in it


@dataclass(frozen=True, eq=False)
class Causes(Record):
    """What turns the plate: rotation vectors in the world in rad, (N, 3), without their means; their sum is the whole.

    links: what constant errors of links and joints explain; guideways: what they cannot, and errors that change along the
    guideways can; rest: neither. chance: probability that guideways without errors would explain as much.
    either: share of the squares of the turns, within that of the links, that errors of guideways explain as well, all of
    it if the poses are in one layer across the guideways;
    chance_of_links: probability that links without errors would explain as much as they do beyond guideways.
    """

    links: Array
    guideways: Array
    rest: Array
    chance: float
    either: float = 0.0
    chance_of_links: float = 0.0

    @property
    def deviations(self) -> dict[str, float]:
        """Root mean square of each part in rad: "links", "guideways", "rest"."""
        parts = dict(links=self.links, guideways=self.guideways, rest=self.rest)
        return {name: float(np.sqrt(np.mean(np.sum(part**2, axis=1)))) for name, part in parts.items()}

    @property
    def shares(self) -> dict[str, float]:
        """The squares of `deviations` by their sum."""
        squares = {name: value**2 for name, value in self.deviations.items()}
        whole = sum(squares.values())
        return {name: square / whole if whole else 0.0 for name, square in squares.items()}

    @property
    def cause(self) -> str:
        """The largest part: "links", "guideways", "rest" if neither explains the errors, or "unknown".

        It is unknown where links seem to be the largest part, yet the poses cannot tell that from guideways: these explain
        as much alone, or they have a part that is certain, and could have most of the rest of it too.
        """
        shares = self.shares
        if self.chance > SURE:
            shares["guideways"] = 0.0
        largest = max(shares, key=lambda name: shares[name])
        if largest != "links":
            return largest
        guideways_alone = self.chance_of_links > SURE
        guideways_too = self.chance <= SURE and self.either > shares["links"] / 2
        return "unknown" if guideways_alone or guideways_too else "links"

    def __str__(self) -> str:
        parts = ", ".join(f"{name} {1e3 * np.degrees(d):.2f}" for name, d in self.deviations.items())
        return (
            f"orientation, root mean square in 0.001 deg: {parts}; guideways by chance: {self.chance:.2g}; "
            f"cause: {self.cause}"
        )


@dataclass(frozen=True, eq=False)
class OrientationErrors(Record):
    """Orientations over the workspace against a reference.

    r (N, 3) in m; R (N, 3, 3); reference (3, 3): their mean, or as given; turns (N, 3): rotation vectors from the
    reference to R, in the world, rad; along (3,): the direction of the guideways.
    """

    r: Array
    R: Array
    reference: Array
    turns: Array
    along: Array

    @property
    def angle(self) -> Array:
        """Angle between each orientation and the reference in rad, (N,)."""
        return np.linalg.norm(self.turns, axis=1)

    @cached_property
    def euler(self) -> Array:
        """ZYZ angles alpha, beta, gamma of R = Rz(alpha) Ry(beta) Rz(gamma) in rad, (N, 3), without jumps by a turn.

        Raises ModelError where beta is nearly zero or pi, as alpha and gamma turn about one axis then.
        """
        R = self.R
        beta = np.arccos(np.clip(R[:, 2, 2], -1.0, 1.0))
        if np.any(np.sin(beta) < np.sin(SINGULAR)):
            raise ModelError(
                "euler: found orientations with beta near 0 or pi, where ZYZ angles are singular, expected others; use "
                "`turns`"
            )
        angles = np.column_stack([
            np.arctan2(R[:, 1, 2], R[:, 0, 2]), beta, np.arctan2(R[:, 2, 1], -R[:, 2, 0]),
        ])  # fmt: skip
        return angles - 2 * np.pi * np.round((angles - angles[0]) / (2 * np.pi))

    @property
    def variation(self) -> Array:
        """Largest less smallest of each ZYZ angle in rad, (3,)."""
        return np.ptp(self.euler, axis=0)

    def by_layers(self, degree: int = 3) -> Causes:
        """Causes by layers, with polynomials of this degree in the three coordinates.

        Raises CalibrationError for poses that all lie at one place along the guideways, or too few.
        """
        return _by_layers(self, degree)

    def plot(self, causes: Causes | None = None, *, file: str | os.PathLike[str] | None = None) -> "Figure":
        """Turns about x, y, z over the poses in the order of their layers, as Figure 4.7, with causes if given."""
        from gantrytau_optimica.calibration.error_analysis.map_figures import draw_orientation

        parts = (
            {} if causes is None else {"by links and joints": causes.links, "by guideways": causes.guideways}
        )
        return draw_orientation(self.r @ self.along, self.turns, parts, file)


def orientation_errors(
    r: Any, R: Any, *, along: Any = (1.0, 0.0, 0.0), reference: Any = None
) -> OrientationErrors:
    """Orientations R (N, 3, 3) measured at r (N, 3) in m against a reference (3, 3), default their mean.

    along: direction of the guideways, (3,). Raises ModelError for other shapes and for matrices that are no rotations.
    """
    found = poses(r, R, "orientation_errors")
    if found.R is None or not np.isfinite(found.r).all():
        raise ModelError(
            "orientation_errors: found poses without orientation or with NaN, expected numbers; leave such rows out"
        )
    direction = array("orientation_errors", "along", along, (3,))
    size = np.linalg.norm(direction)
    if not size > 0:
        raise ModelError("expected a direction", place="orientation_errors", found=Given("along", along))
    if reference is None:
        reference = mean_rotation(found.R)
    reference = poses(np.zeros(3), reference, "orientation_errors: reference").R
    assert reference is not None
    turns = rotation_vector(found.R @ reference[0].T)
    return OrientationErrors(found.r, found.R, reference[0], turns, direction / size)


def orientation_causes(robot: Model | Kinematics, q: Any, r: Any, R: Any, *, degree: int = 4) -> Causes:
    """Causes by closure of the six links of a robot, from measured q (N, 3), r (N, 3) in m and R (N, 3, 3).

    Errors are those against the robot as it is given, constant errors of the plate frame included. degree: of the
    polynomials in q for shifts and turns of each cart. Raises ModelError for a robot without six links on three carts,
    CalibrationError (`.rows`) for too few poses.
    """
    whole("orientation_causes", "degree", degree, least=1)
    kinematics = robot if isinstance(robot, Kinematics) else Kinematics(robot)
    geometry = kinematics.linked("orientation_causes").geometry
    if len(geometry.length) != 6 or geometry.turntables:
        raise ModelError(
            f"orientation_causes: found {len(geometry.length)} links and {len(geometry.turntables)} turntables, expected "
            "six links on three carts, such as SixLinkGantryTau(prototypes.D1)"
        )
    found = poses(r, R, "orientation_causes")
    joints, _ = vectors(q, 3, "q", "orientation_causes")
    if found.R is None or len(joints) != len(found.r):
        raise ModelError(
            f"orientation_causes: found {len(joints)} rows of q and {len(found.r)} poses, expected as many, with R"
        )
    finite = np.isfinite(np.column_stack([joints, found.r])).all(axis=1)
    if not finite.all():
        raise CalibrationError(
            "orientation_causes: found rows that are not finite, expected numbers; leave them out",
            kind="nan",
            rows=np.flatnonzero(~finite),
        )
    return _by_closure(geometry, joints, found.r, found.R, degree)


def _by_closure(geometry: RodGeometry, q: Array, r: Array, R: Array, degree: int) -> Causes:
    length, u, by_pose, _ = geometry.slopes(q, r, R)
    missed = length - geometry.length
    # links, guideways; the last axis: which of them had the choice
    first, second = np.zeros((2, *missed.shape, 2))
    unknowns = np.zeros((2, 2))
    for arm in range(3):
        links = geometry.links_of(arm)
        fixed = _of_links(u[:, links], R)
        moving = _of_guideway(u[:, links], geometry.on_cart[links], q[:, arm], degree)
        right = missed[:, links].reshape(-1, 1)
        for k, columns in enumerate(((fixed, moving), (moving, fixed))):
            explained, counts = _in_turn(*columns, right)
            first[:, links, k], second[:, links, k] = (part.reshape(len(q), -1) for part in explained)
            unknowns[k] += counts
    _enough(missed.size, unknowns[0].sum(), len(q))
    rest = missed[:, :, None] - first - second
    parts = np.concatenate([first[:, :, :1], second, rest[:, :, :1]], axis=2)
    turns = np.linalg.solve(by_pose, parts)[:, 3:]
    turns = turns - turns.mean(axis=0)
    by_links, by_guideways, links_alone, left = np.moveaxis(turns, 2, 0)
    spare = missed.size - unknowns.sum(axis=1)
    chances = [_chance(second[:, :, k], rest[:, :, k], unknowns[k, 1], spare[k]) for k in range(2)]
    along = geometry.direction.mean(axis=0) / np.linalg.norm(geometry.direction.mean(axis=0))
    x = r @ along
    one_layer = np.ptp(x) < LAYERS * np.linalg.norm(np.ptp(r - np.outer(x, along), axis=0))
    return _causes((by_links, by_guideways, left), links_alone * (not one_layer), chances)


def _causes(parts: tuple[Array, Array, Array], links_alone: Array, chances: list[float]) -> Causes:
    """Causes from parts, and from what links explain beyond guideways, with the chances of both second choices."""
    whole = sum(float(np.sum(part**2)) for part in parts)
    both = float(np.sum(parts[0] ** 2) - np.sum(links_alone**2))
    return Causes(*parts, chances[0], max(0.0, both / whole) if whole else 0.0, chances[1])


def _of_links(u: Array, R: Array) -> Array:
    """Columns of constant errors: lengths, joints on the plate and on the cart, (N m, 7 m)."""
    count = u.shape[1]
    local = np.concatenate([np.ones((*u.shape[:2], 1)), -(u @ R), u], axis=2)  # -(R.T u) . db
    whole = np.zeros((len(u), count, count, local.shape[2]))
    whole[:, np.arange(count), np.arange(count)] = local
    return whole.reshape(len(u) * count, -1)


def _of_guideway(u: Array, joints: Array, q: Array, degree: int) -> Array:
    """Columns of shifts and turns of a cart that change with q, (N m, 6 degree)."""
    middle, half = (q.max() + q.min()) / 2, max(np.ptp(q) / 2, 1e-12)
    waves = legvander((q - middle) / half, degree)[:, 1:]
    arms = joints - joints.mean(axis=0)
    motions = np.concatenate([u, np.cross(arms, u)], axis=2)  # u . (w x a) = w . (a x u)
    return (motions[:, :, None, :] * waves[:, None, :, None]).reshape(len(u) * u.shape[1], -1)


def _in_turn(first: Array, second: Array, values: Array) -> tuple[list[Array], Array]:
    """What the first columns explain of values (M, d), and what the second ones do that the first cannot, with ranks."""
    basis = _basis(first)
    explained = basis @ (basis.T @ values)
    beyond = _basis(second - basis @ (basis.T @ second), np.linalg.norm(second, axis=0).max(initial=0.0))
    more = beyond @ (beyond.T @ (values - explained))
    return [explained, more], np.array([basis.shape[1], beyond.shape[1]], dtype=float)


def _basis(columns: Array, scale: float = 0.0) -> Array:
    """An orthonormal basis of what the columns span; directions smaller than rounding of `scale` count as none."""
    left, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    return left[:, sizes > max(SMALLEST * sizes.max(initial=0.0), SMALLEST * scale, 1e-300)]


def _chance(explained: Array, rest: Array, unknowns: float, spare: float) -> float:
    """The F test of whether columns explain more than they would of noise."""
    if unknowns == 0:
        return 1.0
    noise = np.sum(rest**2) / spare
    if noise <= 0:
        return 0.0 if np.any(explained) else 1.0
    from scipy.stats import f as fisher

    return float(fisher.sf(np.sum(explained**2) / unknowns / noise, unknowns, spare))


def _by_layers(found: OrientationErrors, degree: int) -> Causes:
    whole("by_layers", "degree", degree, least=1)
    x = found.r @ found.along
    across = np.linalg.svd(found.along[None])[2][1:]
    y, z = across @ found.r.T
    if np.ptp(x) < LAYERS * max(np.ptp(y), np.ptp(z), 1e-12):
        raise CalibrationError(
            "by_layers: found all poses at one place along the guideways, expected several layers; measure there too",
            kind="one layer",
            rows=np.arange(len(x)),
        )
    powers = [
        (i, j, k) for i in range(degree + 1) for j in range(degree + 1 - i) for k in range(degree + 1 - i - j)
    ]
    scaled = [legvander(_unit(a), degree) for a in (x, y, z)]
    columns = {p: scaled[0][:, p[0]] * scaled[1][:, p[1]] * scaled[2][:, p[2]] for p in powers}
    layer = np.column_stack([column for p, column in columns.items() if p[0] == 0])
    beyond = np.column_stack([column for p, column in columns.items() if p[0] > 0])
    turns = found.turns - found.turns.mean(axis=0)
    (links, guideways), counts = _in_turn(layer, beyond, turns)
    (others, links_alone), _ = _in_turn(beyond, layer, turns)
    _enough(len(x), counts.sum(), len(x))
    rest = turns - links - guideways
    spare = 3 * (len(x) - counts.sum())
    chances = [
        _chance(guideways, rest, 3 * counts[1], spare),
        _chance(links_alone, turns - others - links_alone, 3 * layer.shape[1], spare),
    ]
    return _causes((links, guideways, rest), links_alone, chances)


def _unit(values: Array) -> Array:
    """Values scaled to -1 to 1."""
    return (values - (values.max() + values.min()) / 2) / max(np.ptp(values) / 2, 1e-12)


def _enough(numbers: int, unknowns: float, rows: int) -> None:
    if numbers < SPARE * unknowns:
        raise CalibrationError(
            f"orientation: found {rows} poses for {unknowns:.0f} unknowns, expected {SPARE:g} measured numbers for each; "
            "measure more poses, or lower the degree",
            kind="too few poses",
            rows=np.arange(rows),
        )
