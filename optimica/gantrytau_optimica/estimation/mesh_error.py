"""Discretisation error of an estimate, and its contributions by element.

    every element cut into two:  r': residuals on the finer mesh at the same numbers;  dp = -(J'^T J')^-1 J'^T r'

A step of Gauss and Newton: collocation loses at least a factor of four with half the length, so dp is most of the error.
To first order it is a sum over elements, -(J^T J)^-1 J^T dr/dw G_w^-1 defect, where the defects are those of the coarse
motion in the equations of the finer mesh (Becker, Rannacher (2001), Acta Numerica 10, 1: dual-weighted residuals).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gantrytau_optimica.estimation.corners import corners
from gantrytau_optimica.estimation.fit_on_mesh import RANK, MeshFit, bounded_step
from gantrytau_optimica.estimation.residuals import Residuals, residuals
from gantrytau_optimica.fitting.linear import column_norms
from gantrytau_optimica.solving.warm_start import warm_start
from gantrytau_optimica.transcription.layout import Layout
from gantrytau_optimica.transcription.mesh import Mesh
from gantrytau_optimica.transcription.program import Program
from gantrytau_optimica.transcription.trajectory import Trajectory
from gantrytau_optimica.transcription.transcribe import transcribed_again

COARSE = 0.2  # deviations by which a finer mesh may move a number, or
FINE, FINEST = 1e-7, 1e-11  # of its size, without and with deviations of the data
SCATTER = 0.1  # of the scatter of chi-square, by which the mesh may raise it
CANCELLED = 2.0  # times that: the root of the squares of elements, which may cancel each other
MOST_OF = 0.6  # of the elements: where as many are cut, all are
MUCH = 200.0  # times its share, from which on an element is cut twice
INNER = 0.02  # of an element, off its ends: where it is cut at a corner


@dataclass(frozen=True, eq=False)
class MeshError:
    """Discretisation error of a fit on its mesh.

    finer, w: the mesh of twice the elements, and the motion on it with the parameters of the fit; jacobian: (N, k) there;
    shift: change of the parameters there, about, (k,); parts: contributions (elements, k) to it, by phase; deviations:
    standard deviations there, (k,); allowed: negligible shifts, (k,); misfit: whether the mesh raises chi-square above
    the noise.
    """

    finer: Residuals
    w: np.ndarray
    jacobian: np.ndarray
    shift: np.ndarray
    parts: tuple[np.ndarray, ...]
    deviations: np.ndarray
    allowed: np.ndarray
    misfit: bool = False

    @property
    def stands(self) -> bool:
        """Whether the discretisation error is negligible."""
        return self.numbers_stand and not self.misfit

    @property
    def numbers_stand(self) -> bool:
        """Whether the shift of the parameters is negligible."""
        parts = np.concatenate([np.zeros((1, self.shift.size)), *self.parts])
        whole = np.linalg.norm(parts, axis=0)
        return bool(np.all(np.abs(self.shift) <= self.allowed) and np.all(whole <= CANCELLED * self.allowed))


def mesh_error(fit: MeshFit, known: bool) -> MeshError | None:
    """Discretisation error; None where no motion on a finer mesh is found. known: the data have standard deviations."""
    program = fit.residuals.program
    finer = residuals(transcribed_again(program, meshes=halved(fit)))
    near = carried_over(program, fit.w, finer.program)
    w = finer.on_manifold(near, fit.numbers)
    if w is None:
        return None
    inner, roots = fit.inner, fit.weights.roots
    jacobian, errors = finer.jacobian(w), finer.values(w) * roots
    weighed = jacobian[:, inner] * roots[:, None]
    free, scale = fit.residuals.program.places.free, fit.residuals.program.places.scale
    low, high = program.lbw[free] * scale[free] - fit.numbers, program.ubw[free] * scale[free] - fit.numbers
    shift = np.zeros(fit.numbers.size)
    shift[inner] = bounded_step(weighed, errors, fit.sizes[inner], low[inner], high[inner])
    left = errors + weighed @ shift[inner]
    inverse = _inverse(weighed, fit.sizes[inner])
    deviations = np.zeros(shift.size)
    deviations[inner] = np.sqrt(np.sum(inverse**2, axis=1) * _variance(left, inner, known))
    parts = np.zeros((finer.equations.size, shift.size))
    parts[:, inner] = finer.defects(near, -inverse * roots)
    lost = np.sum((fit.errors * roots) ** 2) - np.sum(left**2)
    return MeshError(
        finer, w, jacobian, shift, _by_element(finer, program.places.layouts, parts), deviations,
        _allowed(deviations, fit, known), misfit=bool(known and lost > SCATTER * np.sqrt(2 * left.size)),
    )  # fmt: skip


def error_against(fit: MeshFit, finer: MeshFit, known: bool) -> MeshError:
    """Discretisation error from a fit on a finer mesh, for motions at active limits of the model."""
    inner, roots = finer.inner, finer.weights.roots
    inverse = _inverse(finer.jacobian[:, inner] * roots[:, None], finer.sizes[inner])
    deviations = np.zeros(fit.numbers.size)
    deviations[inner] = np.sqrt(np.sum(inverse**2, axis=1) * _variance(finer.errors * roots, inner, known))
    shift = finer.numbers - fit.numbers
    return MeshError(
        finer.residuals, finer.w, finer.jacobian, shift, (), deviations, _allowed(deviations, fit, known)
    )


def _variance(errors: np.ndarray, inner: np.ndarray, known: bool) -> float:
    return 1.0 if known else float(errors @ errors) / max(errors.size - int(inner.sum()), 1)


def _allowed(deviations: np.ndarray, fit: MeshFit, known: bool) -> np.ndarray:
    return np.maximum(COARSE * deviations, (FINEST if known else FINE) * fit.sizes)


def carried_over(program: Program, w: np.ndarray, other: Program) -> np.ndarray:
    """Unknowns of `other`, the same problem on other meshes, from those of `program`."""
    numbers = w[program.places.free]
    old = [Trajectory(program.problem, layout, w, numbers) for layout in program.places.layouts]
    found = warm_start(old, other)
    for one, layout in zip(old, other.places.layouts, strict=True):
        if layout.begin.size:
            found[layout.begin] = one.signals(one.times(np.zeros(1)))[len(layout.phase.states) :][
                : layout.begin.size, 0
            ]
    return found


def _inverse(jacobian: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Pseudoinverse (k, N) of a Jacobian (N, k), by columns of equal length."""
    norms = column_norms(jacobian * sizes) / sizes
    return np.linalg.pinv(jacobian / norms, rcond=RANK) / norms[:, None]


def _by_element(finer: Residuals, layouts: Sequence[Layout], parts: np.ndarray) -> tuple[np.ndarray, ...]:
    """Contributions of equations (e, k) summed by the elements that were cut."""
    program = finer.program
    place = np.full(program.assembled.rows, -1)
    place[finer.equations] = np.arange(finer.equations.size)
    found = [np.zeros((layout.mesh.elements, parts.shape[1])) for layout in layouts]
    for group in program.groups:
        inside = (place[group.rows] >= 0) & np.isfinite(group.moments)
        if group.phase < 0 or not np.any(inside):
            continue
        element, _ = layouts[group.phase].mesh.locate(group.moments[inside])
        np.add.at(found[group.phase], element, parts[place[group.rows[inside]]])
    return tuple(found)


def better_meshes(fit: MeshFit, error: MeshError) -> list[Mesh]:
    """The meshes with those elements cut that contribute more than their share of what is allowed."""
    problem, layouts = fit.residuals.program.problem, fit.residuals.program.places.layouts
    total = sum(layout.mesh.elements for layout in layouts)
    meshes = []
    for layout, part in zip(layouts, error.parts, strict=True):
        excess = np.max(np.abs(part) / np.where(error.allowed > 0, error.allowed, np.inf), axis=1) * total
        cuts = np.where(excess > 1.0, 1, 0) + np.where(excess > MUCH, 1, 0)
        meshes.append(_cut(layout.mesh, cuts, corners(problem, layout.phase)))
    cut = sum(mesh.elements for mesh in meshes) - total
    return meshes if cut < MOST_OF * total else halved(fit)


def halved(fit: MeshFit) -> list[Mesh]:
    """The meshes with every element cut into two."""
    program = fit.residuals.program
    return [
        _cut(one.mesh, np.ones(one.mesh.elements, int), corners(program.problem, one.phase))
        for one in program.places.layouts
    ]


def _cut(mesh: Mesh, cuts: np.ndarray, corners: np.ndarray) -> Mesh:
    """Elements cut as often as `cuts` (n,) says: at the corner next to the middle, or else in the middle."""
    while np.any(cuts > 0):
        left, right = mesh.borders[:-1], mesh.borders[1:]
        middle, width = (left + right) / 2, right - left
        if corners.size:
            after = np.clip(np.searchsorted(corners, middle), 1, max(corners.size - 1, 1))
            pair = corners[np.minimum([after - 1, after], corners.size - 1)]
            nearest = np.where(np.abs(pair[0] - middle) <= np.abs(pair[1] - middle), pair[0], pair[1])
            inside = np.abs(nearest - middle) < (0.5 - INNER) * width
            middle = np.where(inside, nearest, middle)
        cut = cuts > 0
        borders = np.sort(np.concatenate([mesh.borders, middle[cut]]))
        cuts = np.repeat(np.maximum(cuts - 1, 0), np.where(cut, 2, 1))
        mesh = Mesh(borders, (), mesh.shortest)
    return mesh
