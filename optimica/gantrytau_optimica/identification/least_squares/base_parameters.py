"""Which parameters a regression tells apart: base parameters by orthogonal factors with pivoting, and their names.

    A p = b, columns normed, A P = Q [R11 R12]: p1 + R11^-1 R12 p2 is what is determined

Gautier (1991), Numerical calculation of the base inertial parameters of robots, J. Robotic Systems 8.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from scipy.linalg import qr, solve_triangular

SILENT = 1e-9  # of a normed column, below which what pivots leave of it is rounding
EMPTY = 1e-13  # of the largest column, below which one is rounding throughout
SMALL = 1e-6  # of normed columns, a share that is rounding


@dataclass(frozen=True, eq=False)
class BaseParameters:
    """Base parameters of a linear regression: the columns that data determine, and how they contain the others.

    independent: (i,) indices of the determined columns; dependent: (d,) indices of the others;
    shares: (i, d), the multiple of each dependent parameter within a base parameter.
    """

    independent: np.ndarray
    dependent: np.ndarray
    shares: np.ndarray

    def words(self, names: Sequence[str]) -> tuple[str, ...]:
        """What is determined in place of parameters that cannot be told apart: `plate_mass + 0.5 link_masses[0]`."""
        found = []
        for row, i in enumerate(self.independent):
            terms = [
                f"{'+' if share > 0 else '-'} {'' if abs(abs(share) - 1) < SMALL else f'{abs(share):.3g} '}{names[int(d)]}"
                for share, d in zip(self.shares[row], self.dependent, strict=True)
                if share
            ]
            found += [" ".join([names[int(i)], *terms])] if terms else []
        return tuple(found)

    def silent(self, names: Sequence[str]) -> tuple[str, ...]:
        """Parameters without any influence."""
        return tuple(names[int(d)] for k, d in enumerate(self.dependent) if not np.any(self.shares[:, k]))


def base_parameters(factor: np.ndarray) -> BaseParameters:
    """Base parameters of a regression by its triangular factor (k, k), or by its columns."""
    norms = np.linalg.norm(factor, axis=0)
    scale = np.where(norms > EMPTY * np.max(norms, initial=0.0), norms, np.inf)
    found = qr(factor / scale, mode="economic", pivoting=True)
    _, R, order = cast(tuple[np.ndarray, np.ndarray, np.ndarray], found)
    size = np.abs(np.diag(R))
    rank = int(np.sum(size > SILENT))
    first, rest = order[:rank], order[rank:]
    shares = solve_triangular(R[:rank, :rank], R[:rank, rank:])
    shares[np.abs(shares) < SMALL] = 0.0
    with np.errstate(invalid="ignore"):
        shares = np.where(np.isfinite(scale[rest]), shares * scale[rest] / scale[first][:, None], 0.0)
    return BaseParameters(first, rest, np.nan_to_num(shares))
