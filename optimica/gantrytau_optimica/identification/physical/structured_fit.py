"""M = S S' and K = S S' definite and D symmetric by construction: the form that is nearest to what is known.

The unknowns are lower triangles, (n, n) each: S of M, D, S of K, one after the other, in units of a mass and a frequency.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from gantrytau_optimica.identification.physical.mechanical_form import MechanicalForm, is_definite

LEAST = 1e-9  # of the largest eigenvalue, that starts are raised to
STEPS = 100  # of the fit
DONE = 1e-13  # change of squares and of unknowns


class Known(Protocol):
    """Data of the fit of a form: response of a model, or measured motion."""

    @property
    def frequency(self) -> float: ...
    def left(self, form: MechanicalForm) -> np.ndarray: ...
    def missed(self, form: MechanicalForm) -> float: ...


def structured_form(known: Known, start: MechanicalForm) -> MechanicalForm:
    """The best definite M and K and symmetric D: the least squares of `known.left`.

    start: where to begin; its symmetric parts are used, raised to definite ones.
    """
    from scipy.optimize import least_squares

    unknowns = Unknowns(len(start.M), float(np.linalg.norm(start.M)), known.frequency)
    found = least_squares(
        lambda p: known.left(unknowns.form(p)),
        unknowns.of(start),
        jac="3-point",
        x_scale="jac",
        xtol=DONE,
        ftol=DONE,
        gtol=DONE,
        max_nfev=STEPS,
    )
    return unknowns.form(found.x)


def explained(known: Known, form: MechanicalForm) -> float:
    """Fit in %: what a form does not leave, by norms."""
    return 100 * (1 - float(np.linalg.norm(known.left(form))))


@dataclass(frozen=True)
class Unknowns:
    """Forms of n coordinates as vectors, in units of a mass m in kg and a frequency w in 1/s."""

    n: int
    m: float
    w: float

    def form(self, p: np.ndarray) -> MechanicalForm:
        """The form that the unknowns stand for."""
        S_M, D, S_K = np.zeros((3, self.n, self.n))
        for lower, values in zip((S_M, D, S_K), np.reshape(p, (3, -1)), strict=True):
            lower[np.tril_indices(self.n)] = values
        M, D, K = S_M @ S_M.T, D + np.tril(D, -1).T, S_K @ S_K.T
        return MechanicalForm(self.m * M, self.m * self.w * D, self.m * self.w**2 * K)

    def of(self, form: MechanicalForm) -> np.ndarray:
        """The unknowns of a form that is made symmetric, M and K definite."""
        D = (form.D + form.D.T) / 2 / (self.m * self.w)
        M, K = _root(form.M / self.m), _root(form.K / (self.m * self.w**2))
        return np.concatenate([lower[np.tril_indices(self.n)] for lower in (M, D, K)])


def _root(x: np.ndarray) -> np.ndarray:
    """Lower triangle S of S S', the symmetric part of a matrix, with eigenvalues of the other sign turned."""
    whole = (x + x.T) / 2
    if not is_definite(whole):
        values, vectors = np.linalg.eigh(whole)
        size = np.abs(values)
        whole = vectors @ np.diag(np.maximum(size, LEAST * size.max())) @ vectors.T
    return np.linalg.cholesky(whole)
