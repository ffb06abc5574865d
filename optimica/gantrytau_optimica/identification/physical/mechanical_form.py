"""Mass, damping and stiffness as one record, which answers with modes and as a linear system."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.answers.linear_systems.state_space import StateSpace
from gantrytau.describing.record import Record
from gantrytau_optimica.identification.physical.vibration_modes import Modes, modes_of, without_damping

DEFINITE = 1e-12  # of the largest eigenvalue, above which the smallest is above zero


@dataclass(frozen=True, eq=False, repr=False)
class MechanicalForm(Record):
    """M z'' + D z' + K z = f, z = (M s^2 + D s + K)^-1 f: M in kg, D in kg/s, K in N/m, (n, n) each.

    Numbers do for n = 1. Raises ModelError for matrices that do not fit together, are not finite, or an M without inverse.
    """

    M: Any
    D: Any
    K: Any

    def __post_init__(self):
        for name in ("M", "D", "K"):
            try:
                found = np.array(np.atleast_2d(getattr(self, name)), dtype=float)
            except (TypeError, ValueError):
                raise ModelError(
                    f"{type(self).__name__}: found {name} that is no matrix of numbers", argument=name
                ) from None
            shape = (len(found), len(found)) if name == "M" else self.M.shape
            if found.shape != shape or not found.size:
                raise ModelError(
                    f"{type(self).__name__}: {name} has shape {found.shape}, expected {shape}: a row and a column for each "
                    "coordinate",
                    argument=name,
                )
            if not np.all(np.isfinite(found)):
                raise ModelError(f"{type(self).__name__}: {name} is not finite; repair it", argument=name)
            found.flags.writeable = False
            object.__setattr__(self, name, found)
        if np.linalg.cond(self.M) > 1 / np.finfo(float).eps:
            raise ModelError(
                f"{type(self).__name__}: found M = {self.M.tolist()}, which has no inverse, expected a mass in every "
                "direction",
                argument="M",
            )

    @property
    def indefinite(self) -> tuple[str, ...]:
        """Which of M, D, K take energy from nothing: z' M z and the like is not above zero for some motion z."""
        return tuple(name for name in ("M", "D", "K") if not is_definite(getattr(self, name)))

    @property
    def definite(self) -> bool:
        """Whether z' M z, z' D z and z' K z are above zero for every motion, as energies and losses are."""
        return not self.indefinite

    @property
    def asymmetry(self) -> dict[str, float]:
        """|X - X'| / |X + X'| of M, D and K by Frobenius norm: 0 where forces and motions belong to each other."""
        return {
            name: float(np.linalg.norm(x - x.T) / max(np.linalg.norm(x + x.T), np.finfo(float).tiny))
            for name, x in (("M", self.M), ("D", self.D), ("K", self.K))
        }

    @cached_property
    def modes(self) -> Modes:
        """Frequencies, damping ratios and shapes: det(M s^2 + D s + K) = 0, (6.15) with damping."""
        return modes_of(self.M, self.D, self.K)

    @property
    def undamped(self) -> np.ndarray:
        """Resonances without damping, (n,) in Hz, rising: (6.15); NaN where M and K do not swing."""
        return without_damping(self.M, self.K)

    @property
    def system(self) -> StateSpace:
        """From forces to positions, continuous; states are positions and speeds."""
        n = len(self.M)
        inverse = np.linalg.inv(self.M)
        zero, one = np.zeros((n, n)), np.eye(n)
        A = np.block([[zero, one], [-inverse @ self.K, -inverse @ self.D]])
        return StateSpace(A, np.vstack([zero, inverse]), np.hstack([one, zero]))

    def response(self, s: np.ndarray) -> np.ndarray:
        """(M s^2 + D s + K)^-1 at s (N,) in 1/s, (N, n, n) complex; (6.14)."""
        s = np.asarray(s)[:, None, None]
        return np.linalg.inv(self.M * s**2 + self.D * s + self.K)

    def __repr__(self) -> str:
        lines = [f"  {name} = {getattr(self, name).tolist()}" for name in ("M", "D", "K")]
        return "\n".join([f"<{type(self).__name__} of {len(self.M)} coordinates", *lines]) + ">"


def is_definite(x: np.ndarray) -> bool:
    """Whether z' x z > 0 for all z: eigenvalues of the symmetric part are above zero."""
    values = np.linalg.eigvalsh(x + x.T)
    return bool(values[0] > DEFINITE * max(abs(values[-1]), abs(values[0])))
