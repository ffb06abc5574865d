"""The elements of a phase: their borders, fixed or placed by the optimiser."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from gantrytau import ModelError
from gantrytau.border.checks import array, whole
from gantrytau.border.refusal import Given
from gantrytau_optimica.control.control_problem import Phase

SHORTEST = 0.1  # of its length in the guess, for a stretch between two moving borders


@dataclass(frozen=True, eq=False)
class Mesh:
    """Borders of elements as shares of the horizon, (n + 1,) from 0 to 1.

    moving: numbers of the borders that the optimiser places; those between two of them keep their share of the
    stretch. shortest: length of a stretch relative to the guess below which it must not shrink.
    """

    borders: np.ndarray
    moving: tuple[int, ...] = ()
    shortest: float = SHORTEST

    @property
    def elements(self) -> int:
        """N."""
        return self.borders.size - 1

    @property
    def widths(self) -> np.ndarray:
        """Lengths of the elements, (n,)."""
        return np.diff(self.borders)

    def shares(self) -> tuple[Any, np.ndarray]:
        """(n + 1, m) sparse and (n + 1,): all borders from those that move."""
        knots = np.array([0, *self.moving, self.elements])
        stretch = np.clip(
            np.searchsorted(knots, np.arange(self.elements + 1), side="right") - 1, 0, knots.size - 2
        )
        left, right = knots[stretch], knots[stretch + 1]
        share = (self.borders - self.borders[left]) / (self.borders[right] - self.borders[left])
        row = np.arange(self.elements + 1)
        whole = sparse.coo_matrix(
            (np.concatenate([1 - share, share]), (np.tile(row, 2), np.concatenate([stretch, stretch + 1]))),
            shape=(row.size, knots.size),
        ).tocsr()
        whole.eliminate_zeros()
        return whole[:, 1:-1], np.asarray(whole[:, -1].todense()).ravel()

    def placed(self, borders: np.ndarray) -> "Mesh":
        """The mesh with the moving borders where `borders` (m,) says, and the others between them."""
        matrix, offset = self.shares()
        return Mesh(matrix @ borders + offset, self.moving, self.shortest)  # shares stay

    def locate(self, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Element and place in it, 0 to 1, of shares of the horizon; a border belongs to the element before it."""
        share = np.clip(share, 0.0, 1.0)
        element = np.clip(
            np.searchsorted(self.borders, share - 1e-13, side="right") - 1, 0, self.elements - 1
        )
        return element, (share - self.borders[element]) / self.widths[element]


def mesh_of(elements: Any, free_lengths: bool = False) -> Mesh:
    """A mesh from a number of equal elements, or from lengths relative to each other. Raises ModelError."""
    if isinstance(elements, (Sequence, np.ndarray)) and not isinstance(elements, str):
        lengths = array("", "elements", elements, (None,))
        if not lengths.size or np.any(lengths <= 0):
            raise ModelError("expected lengths above 0", found=Given("elements", elements))
        borders = np.concatenate([[0.0], np.cumsum(lengths / lengths.sum())])
        borders[-1] = 1.0
    else:
        borders = np.linspace(0.0, 1.0, whole("", "elements", elements, least=1) + 1)
    return Mesh(borders, tuple(range(1, borders.size - 1)) if free_lengths else ())


def with_jumps(mesh: Mesh, phase: Phase) -> Mesh:
    """The mesh with borders where a known input jumps, if the times of the phase are fixed. ModelError if borders move."""
    jumps = [course.jumps for course in phase.courses if course.jumps.size]
    if not jumps or not (phase.start_time.is_constant() and phase.final_time.is_constant()):
        return mesh
    if mesh.moving:
        name = next(course.name for course in phase.courses if course.jumps.size)
        why = "expected 'given', as borders stand at the steps of this input"
        raise ModelError(why, place=name, found=Given("lengths", "free"))
    start, final = float(phase.start_time), float(phase.final_time)
    return with_borders(mesh, (np.concatenate(jumps) - start) / (final - start))


def with_borders(mesh: Mesh, shares: np.ndarray) -> Mesh:
    """The mesh with more borders, where an input jumps; those within 1e-9 of another are left out."""
    every = np.unique(np.concatenate([mesh.borders, shares[(shares > 1e-9) & (shares < 1 - 1e-9)]]))
    kept = every[np.concatenate([[True], np.diff(every) > 1e-9])]
    kept[-1] = 1.0
    return Mesh(kept, (), mesh.shortest)
