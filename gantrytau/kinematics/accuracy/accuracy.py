"""How far errors of the actuators carry the tool of a three-link robot: Dressler (2012), Appendix A.

Each cart lies in an ellipsoid about its nominal place A_i, with semi-axes r_ij along the axes e_j of the base. The links
then leave the tool a region, of which three descriptions are compared:

- printed (A.1, A.2): between pairs of ellipsoids about A_i with semi-axes L_i -/+ r_ij along e_j; where three of them
  meet are the eight corners. It underestimates anisotropic errors by some per cent.
- first order (A.4): the parallelepiped |u_i.x| <= h_i, with u_i the directions of the links and
  h_i = sqrt(sum_j (r_ij u_ij)^2) the support of the ellipsoid: what an error changes at most along its link.
- bound: between spheres about A_i of radius L_i -/+ h_i; with what is said in `_bound` nothing reaches beyond it.
"""

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, overload

import numpy as np
from numpy.typing import ArrayLike

from gantrytau.border.checks import array, check_words, whole
from gantrytau.border.refusal import Given, ModelError
from gantrytau.describing.record import Record
from gantrytau.kinematics.accuracy.figures import draw_levels
from gantrytau.kinematics.accuracy.joint_errors import JointErrors, joint_errors
from gantrytau.kinematics.kinematics import Kinematics
from gantrytau.kinematics.poses import vectors
from gantrytau.kinematics.rods.rod_robots import ThreeRods
from gantrytau.kinematics.rotations import angle_between, cross
from gantrytau.language.model import Model

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SIGNS = np.array([[a, b, c] for a in (-1.0, 1.0) for b in (-1.0, 1.0) for c in (-1.0, 1.0)])
_BLOCK = 4096  # poses whose arrays stay in the cache
_CONVERGED = 1e-12  # m, a hundred roundings of a coordinate
_MET = 1e-9  # m, by which what is not solved misses by far
_PASSES = 20  # three suffice where the links are not in one plane


@dataclass(frozen=True, eq=False)
class Accuracy(Record):
    """Errors of the tool in N poses. Rows out of reach are NaN. Where links are almost in one plane, so that errors pull
    them apart, corners are NaN and error and bound infinite.

    r: tool (N, 3) in m; carts: A_i (N, 3, 3) in m; lengths: (3,) in m; semi_axes: r_ij (3, 3) in m.
    corners: the corners of the printed region (A.2), places in the world, (N, 8, 3) in m; the order is that of
    SIGNS, -1 for the inner and 1 for the outer ellipsoid of each arm.
    error: largest distance of a corner from the tool, (N,) in m. bound: upper bound of errors from inside
    the ellipsoids, (N,) in m. half_widths: h_i (N, 3) in m. areas: faces of the parallelepiped, those orthogonal to link i
    in column i, (N, 3) in m2. directions: unit vectors u_i from tool to carts, (N, 3, 3). passes: iterations of A.2.
    """

    r: np.ndarray
    carts: np.ndarray
    lengths: np.ndarray
    semi_axes: np.ndarray
    corners: np.ndarray
    error: np.ndarray
    bound: np.ndarray
    half_widths: np.ndarray
    areas: np.ndarray
    directions: np.ndarray
    passes: int

    @property
    def parallelepiped(self) -> np.ndarray:
        """Corners of |u_i.x| <= h_i as displacements of the tool, (N, 8, 3) in m (A.4)."""
        right = SIGNS * self.half_widths[:, None]
        return _solve(self.directions[:, None], right)

    @property
    def angles(self) -> np.ndarray:
        """Angles between links 2 and 3, 3 and 1, 1 and 2, (N, 3) in rad; orthogonal links make the error least."""
        u = self.directions
        cosines = np.stack([(u[:, (k + 1) % 3] * u[:, (k + 2) % 3]).sum(-1) for k in range(3)], axis=-1)
        return np.arccos(np.clip(cosines, -1.0, 1.0))

    @property
    def dihedral_angles(self) -> np.ndarray:
        """Angles at links 1, 2 and 3 between the planes through it and either other link, (N, 3) in rad (beta_k of A.4).

        The sides of the face orthogonal to a link meet at this angle and at its supplement.
        """
        u = self.directions
        sides = cross(u, u[:, [1, 2, 0]]), cross(u, u[:, [2, 0, 1]])
        return angle_between(*sides)

    def sampled(self, samples: int = 1000, *, seed: int = 0) -> np.ndarray:
        """Displacements of the tool for random errors on the ellipsoids, (N, samples, 3) in m: the Monte Carlo check.

        The meeting point of the links is computed exactly for displaced carts; errors are the same in every pose.
        """
        whole("sampled", "samples", samples, least=1)
        random = np.random.default_rng(seed).normal(size=(samples, 3, 3))
        errors = random / np.linalg.norm(random, axis=-1, keepdims=True) * self.semi_axes
        return self.displaced(errors)

    def displaced(self, errors: np.ndarray) -> np.ndarray:
        """Displacements of the tool, (N, k, 3) in m, for errors of the carts (k, 3, 3) or (N, k, 3, 3) in m."""
        shapes = (None, 3, 3), (len(self.r), None, 3, 3)
        carts = self.carts[:, None] + array("displaced", "errors", errors, *shapes, unit="m")
        start = np.broadcast_to(self.r[:, None], (*carts.shape[:2], 3))
        return _meet(carts, self.lengths, start) - self.r[:, None]

    def plot(
        self,
        quantity: Literal["error", "bound", "areas", "angles", "dihedral angles"] = "error",
        *,
        axes: str = "yz",
        file: str | os.PathLike[str] | None = None,
    ) -> "Figure":
        """Level plot over a slice of poses (Figures 4.8 to 4.10).

        quantity: "error", "bound", "areas" of the faces, "angles" between links, or "dihedral angles" at links;
        axes: the two coordinates that vary, such as "yz"; file: saves the figure there, too.
        Raises ModelError for another quantity, other axes, or poses that lie on one line.
        """
        check_words(Accuracy.plot, locals())
        inside = np.isfinite(self.error)
        return draw_levels(self._panels(quantity), self.r, inside, self.carts, axes, file)

    def _panels(self, quantity: str) -> dict[str, np.ndarray]:
        """Labels and values of the panels of a figure."""
        if quantity == "error":
            return {"largest error of the tool [µm]": self.error * 1e6}
        if quantity == "bound":
            return {"bound of the error of the tool [µm]": self.bound * 1e6}
        if quantity == "areas":
            return {f"face orthogonal to link {i + 1} [10⁻³ mm²]": self.areas[:, i] * 1e9 for i in range(3)}
        if quantity == "angles":
            pairs = ((2, 3), (3, 1), (1, 2))
            angles = np.rad2deg(self.angles)
            return {f"angle of links {i} and {j} [°]": angles[:, k] for k, (i, j) in enumerate(pairs)}
        angles = np.rad2deg(self.dihedral_angles)
        return {f"angle of the sides that meet at link {i + 1} [°]": angles[:, i] for i in range(3)}


@overload
def accuracy(robot: Model | Kinematics, r: ArrayLike, semi_axes: ArrayLike) -> Accuracy: ...


@overload
def accuracy(
    robot: Model | Kinematics, r: ArrayLike, *, errors: ArrayLike, R: ArrayLike | None = None
) -> JointErrors: ...


def accuracy(
    robot: Model | Kinematics,
    r: ArrayLike,
    semi_axes: ArrayLike | None = None,
    *,
    errors: ArrayLike | None = None,
    R: ArrayLike | None = None,
) -> Accuracy | JointErrors:
    """Errors of the tool for errors of the actuators: of a three-link robot by ellipsoids (Appendix A), of any by joints.

    robot: an instance such as GantryTau(prototypes.D1), or its Kinematics; r: places of the tool, (N, 3) or (3,), in m;
    semi_axes: of the error ellipsoids along the axes of the base, (3, 3) in m, one row per actuator; or errors: the largest
    of each joint, (n,) in m and rad, with the orientation R, (3, 3) or (N, 3, 3), by default that of the start where joints
    choose it. Raises ModelError for other robots, shapes, or errors that are negative or, as semi-axes, not small.
    """
    kinematics = robot if isinstance(robot, Kinematics) else Kinematics(robot)
    if errors is not None and semi_axes is None:
        return joint_errors(kinematics, r, R, errors)
    if semi_axes is None or errors is not None:
        raise ModelError(
            f"{kinematics.dae.name}: found {'neither' if errors is None else 'both'} semi_axes and errors, expected one: "
            "ellipsoids (3, 3) of the carts of a three-link robot, or errors= of the joints of any robot"
        )
    linked, name = kinematics.linked("accuracy"), kinematics.dae.name
    if not isinstance(linked, ThreeRods):
        raise ModelError(
            f"{name}: found {len(linked.geometry.length)} links, expected three that end in the tool; ask for the accuracy "
            "of the three-link robot, as GantryTau(prototypes.D1)"
        )
    places, _ = vectors(r, 3, "r", name)
    lengths = linked.geometry.length
    axes = array("accuracy", "semi_axes", semi_axes, (3, 3), unit="m", least=0.0)
    if not (axes < 0.1 * lengths.min()).all():
        found = Given("semi_axes", semi_axes)
        raise ModelError("expected lengths in m below a tenth of a link", place="accuracy", found=found)
    carts = linked.geometry.cart_joints(kinematics.ik(places))
    parts = [slice(k, k + _BLOCK) for k in range(0, len(places), _BLOCK)] or [slice(0)]
    blocks = [_of_block(carts[part], lengths, places[part], axes) for part in parts]
    columns = {
        name: np.concatenate([block[name] for block in blocks]) for name in blocks[0] if name != "passes"
    }
    passes = max(block["passes"] for block in blocks)
    return Accuracy(r=places, carts=carts, lengths=lengths, semi_axes=axes, passes=passes, **columns)


def _of_block(carts: np.ndarray, lengths: np.ndarray, r: np.ndarray, semi_axes: np.ndarray) -> dict:
    """The fields of Accuracy for some poses."""
    u = (carts - r[:, None]) / lengths[:, None]
    half = np.sqrt(((u * semi_axes) ** 2).sum(-1))
    corners, passes = _corners(carts, lengths, semi_axes, r)
    with np.errstate(divide="ignore", invalid="ignore"):
        determinant = np.abs(np.linalg.det(u))
        areas = 4 * half[:, [1, 2, 0]] * half[:, [2, 0, 1]] / determinant[:, None]
    return dict(
        corners=corners,
        error=_farthest(corners, carts, r),
        bound=_bound(carts, lengths, semi_axes, r, u),
        half_widths=half,
        areas=areas,
        directions=u,
        passes=passes,
    )


def _corners(
    carts: np.ndarray, lengths: np.ndarray, semi_axes: np.ndarray, r: np.ndarray
) -> tuple[np.ndarray, int]:
    """Where three ellipsoids meet, (N, 8, 3), by the iteration A.2: tangent planes meet, and touch anew from there."""
    centres = carts[:, None]
    weights = (lengths[:, None] + SIGNS[:, :, None] * semi_axes) ** -2.0  # (8, 3, 3), diagonals of M_i
    x = np.broadcast_to(r[:, None], (len(r), 8, 3))
    passes = 0
    while True:
        gap = x[:, :, None] - centres
        touching = gap / np.sqrt((gap**2 * weights).sum(-1, keepdims=True))
        miss: np.ndarray = np.abs(touching - gap).max(axis=(-1, -2))
        if passes == _PASSES or miss.max(initial=0.0, where=np.isfinite(miss)) < _CONVERGED:
            break
        normals = touching * weights
        x = _solve(normals, 1.0 + (normals * centres).sum(-1))
        passes += 1
    return np.where(miss[..., None] < _MET, x, np.nan), passes


def _bound(
    carts: np.ndarray, lengths: np.ndarray, semi_axes: np.ndarray, r: np.ndarray, u: np.ndarray
) -> np.ndarray:
    """The farthest that the tool gets while each cart stays in its ellipsoid, (N,) in m.

    A cart at A + a keeps its link, |Y - a| = L with Y = T + x - A. For all a in the ellipsoid of support h and largest
    semi-axis p, |Y| - h <= |Y - a| <= |Y| + h + p^2 / (2 |Y|), so that | |Y| - L | <= h + p^2 / (2 (L - p)): the tool is
    in a shell about A. Of the region in which three shells meet the farthest points are corners; h depends on the
    direction of Y there, which the iteration follows.
    """
    largest = semi_axes.max(axis=1)
    slack = largest**2 / (2 * (lengths - largest))
    x = np.broadcast_to(r[:, None], (len(r), 8, 3))
    directions = np.broadcast_to(u[:, None], (len(r), 8, 3, 3))
    for _ in range(3):  # a direction turns by 1e-4 at most; the third pass changes nothing that doubles hold
        half = np.sqrt(((directions * semi_axes) ** 2).sum(-1)) + slack
        x = _meet(carts[:, None], lengths + SIGNS * half, x)
        gap = carts[:, None] - x[:, :, None]
        directions = gap / np.linalg.norm(gap, axis=-1, keepdims=True)
    return _farthest(x, carts, r) + 10 * _CONVERGED


def _farthest(corners: np.ndarray, carts: np.ndarray, r: np.ndarray) -> np.ndarray:
    """Largest distance of corners (N, 8, 3) from the tool; infinite where one is missing although the tool is in reach."""
    distance = np.linalg.norm(corners - r[:, None], axis=-1).max(axis=-1)
    return np.where(np.isnan(distance) & np.isfinite(carts).all(axis=(1, 2)), np.inf, distance)


def _meet(centres: np.ndarray, lengths: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Where spheres of these centres (..., 3, 3) and radii (..., 3) meet next to `near`, (..., 3), by Newton steps.

    NaN where they do not meet.
    """
    x = near
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(_PASSES):
            gap = x[..., None, :] - centres
            step = _solve(2 * gap, lengths**2 - (gap**2).sum(-1))
            x = x + step
            if np.abs(step).max(initial=0.0, where=np.isfinite(step)) < _CONVERGED:
                break
        met = (np.abs(np.linalg.norm(x[..., None, :] - centres, axis=-1) - lengths) < _MET).all(axis=-1)
    return np.where(met[..., None], x, np.nan)


def _solve(rows: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solutions x of rows @ x = right for many systems of three equations; not finite where the rows lie in one plane."""
    one, two, three = rows[..., 0, :], rows[..., 1, :], rows[..., 2, :]
    first, second, third = np.cross(two, three), np.cross(three, one), np.cross(one, two)
    total = right[..., :1] * first + right[..., 1:2] * second + right[..., 2:] * third
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return total / (one * first).sum(-1, keepdims=True)
