"""Identifiable combinations of parameters, and the one message for indistinguishable ones: `not_told_apart`.

    J P = Q [R11 R12; 0 0],  columns normed         p1 + R11^-1 R12 p2 is determined: base parameters (Gautier 1991)
    J S = U diag(s) V',  s_i = 0                    a change along S V_i moves no residual: the same from null directions
    p_1 + sum_d share_1d p_d                        what is determined in place of p_1 and the dependent p_d

Where residuals are not linear in the parameters, the null direction of two is looked at in two points: one that keeps a
ratio, a product, a sum or a difference in both says so. Gautier (1991), Numerical calculation of the base inertial
parameters of robots, J. Robotic Systems 8; Golub, Van Loan (2013), Matrix Computations, section 5.5.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from scipy.linalg import qr, solve_triangular
from scipy.sparse.csgraph import connected_components

from gantrytau.describing.record import Record
from gantrytau_optimica.fitting.linear import column_norms

PIVOT = 1e-9  # of a normed column, below which what pivots leave of it is rounding
EMPTY = 1e-13  # of the largest column, below which one is rounding throughout
SMALL = 1e-6  # of normed columns, a share that is rounding
TAKES_PART = 0.05  # of a direction: components below are exact but negligible, as those Table 5.4 leaves out
DOUBTFUL = 1e-5  # of the largest singular value of normed columns: below it parameters may not be told apart
ROUNDING = 1e-11  # of it, what rounding leaves of a value that is zero
NEARLY = 1e-7  # the same, where the law behind a null direction is looked for
CONFIRMED = 0.5  # of what a combined change moves on a mesh, by which a finer one may differ
SILENT = 1e-10  # of the measured values: a parameter that moves them less, when doubled, has no influence
EXPONENTS = {1.0: "", 2.0: "^2", 3.0: "^3", 4.0: "^4", 1.5: "^(3/2)"}  # of simple laws
SURE = 1e-3  # how closely a ratio of changes is to be a simple number


def not_told_apart(names: Sequence[str], determined: Sequence[str]) -> str:
    """Message on indistinguishable parameters; determined: their identifiable combinations, none without influence."""
    if not determined:
        return f"nothing that was measured depends on {listed(names)}"
    verb = "is" if len(determined) == 1 else "are"
    return f"{indistinguishable(names)}: only {listed(determined)} {verb} determined"


def indistinguishable(names: Sequence[str]) -> str:
    """Message on parameters of one null direction, without combinations; a single name has no influence."""
    return (
        f"{listed(names)} cannot be told apart by these data" if len(names) > 1 else not_told_apart(names, ())
    )


def listed(words: Sequence[str]) -> str:
    """Words in a sentence: `a, b and c`."""
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


@dataclass(frozen=True, eq=False)
class BaseParameters(Record):
    """Base parameters: identifiable linear combinations of the columns of a Jacobian.

    independent: (i,) indices of the determined columns; dependent: (d,) indices of the others;
    shares: (i, d), the multiple of each dependent parameter within a base parameter.
    """

    independent: np.ndarray
    dependent: np.ndarray
    shares: np.ndarray

    def words(self, names: Sequence[str]) -> tuple[str, ...]:
        """Determined combinations of indistinguishable parameters: `plate_mass + 0.5 link_masses[0]`."""
        return tuple(
            self._sum(row, names) for row in range(len(self.independent)) if np.any(self.shares[row])
        )

    def silent(self, names: Sequence[str]) -> tuple[str, ...]:
        """Parameters without any influence."""
        return tuple(names[int(d)] for k, d in enumerate(self.dependent) if not np.any(self.shares[:, k]))

    def messages(self, names: Sequence[str]) -> list[str]:
        """Message for each group of indistinguishable parameters, parameters without influence first."""
        found = [not_told_apart(silent, ())] if (silent := self.silent(names)) else []
        linked = self.shares != 0
        _, group = connected_components(linked.T.astype(int) @ linked.astype(int), directed=False)
        for k in dict.fromkeys(group[np.any(linked, axis=0)].tolist()):
            rows = np.flatnonzero(linked[:, group == k].any(axis=1)).tolist()
            members = sorted([*self.independent[rows], *self.dependent[group == k]])
            determined = [self._sum(row, names) for row in rows]
            found.append(not_told_apart([names[int(k)] for k in members], determined))
        return found

    def _sum(self, row: int, names: Sequence[str]) -> str:
        terms = [names[int(self.independent[row])]]
        for share, d in zip(self.shares[row], self.dependent, strict=True):
            size = "" if abs(abs(share) - 1) < SMALL else f"{abs(share):.3g} "
            terms += [f"{'+' if share > 0 else '-'} {size}{names[int(d)]}"] if share else []
        return " ".join(terms)


def base_parameters(factor: np.ndarray) -> BaseParameters:
    """Base parameters of a regression by its triangular factor (k, k), or by its columns."""
    norms = np.linalg.norm(factor, axis=0)
    scale = np.where(norms > EMPTY * np.max(norms, initial=0.0), norms, np.inf)
    found = qr(factor / scale, mode="economic", pivoting=True)
    _, R, order = cast(tuple[np.ndarray, np.ndarray, np.ndarray], found)
    rank = int(np.sum(np.abs(np.diag(R)) > PIVOT))
    first, rest = order[:rank], order[rank:]
    shares = solve_triangular(R[:rank, :rank], R[:rank, rank:])
    shares[np.abs(shares) < SMALL] = 0.0
    with np.errstate(invalid="ignore"):
        shares = np.where(np.isfinite(scale[rest]), shares * scale[rest] / scale[first][:, None], 0.0)
    return BaseParameters(first, rest, np.nan_to_num(shares))


def base_of_directions(directions: np.ndarray, scale: np.ndarray) -> BaseParameters:
    """Base parameters by null directions (k, p), orthonormal in the scaled parameters.

    From the last parameter to the first each that takes part in some direction becomes dependent and leaves the rest, until
    none is left: the reduced echelon form, but for pivots that are negligible.
    """
    left, pivots = directions, []
    for k in reversed(range(len(scale))):
        if len(left) == 0:
            break
        size = np.linalg.norm(left[:, k])
        if size > TAKES_PART:
            pivots.append(k)
            # a basis of what has no component k any more
            left = np.linalg.qr(np.column_stack([left[:, k] / size, np.eye(len(left))]))[0][:, 1:].T @ left
    pivots = np.array(sorted(pivots), dtype=int)
    others = np.setdiff1d(np.arange(len(scale)), pivots)
    if not pivots.size:
        return BaseParameters(others, pivots, np.zeros((len(others), 0)))
    unscaled = directions * scale
    rows = np.linalg.lstsq(unscaled[:, pivots].T, np.eye(len(pivots)), rcond=None)[0].T @ unscaled
    shares = -rows[:, others].T
    return BaseParameters(others, pivots, np.where(np.abs(shares) > TAKES_PART, shares, 0.0))


def dependencies(directions: np.ndarray, scale: np.ndarray, names: Sequence[str]) -> dict[str, list[str]]:
    """Dependent parameters of null directions by name, each with the parameters collinear with it."""
    base = base_of_directions(directions, scale)
    return {
        names[int(d)]: [names[int(i)] for i in base.independent[column != 0]]
        for d, column in zip(base.dependent, base.shares.T, strict=True)
    }


@dataclass(frozen=True, eq=False)
class LocalJacobian:
    """Jacobian of the residuals (N, k) by parameters, and their values (k,), at one point; N >= k."""

    jacobian: np.ndarray
    values: np.ndarray

    def of(self, some: Sequence[int]) -> "LocalJacobian":
        """Jacobian and values of some parameters."""
        return LocalJacobian(self.jacobian[:, some], self.values[some])


def without_influence(point: LocalJacobian, sizes: np.ndarray) -> list[int]:
    """Indices of parameters without influence on any residual; residuals over the size of the measured values."""
    moved = np.linalg.norm(point.jacobian * sizes, axis=0)
    return np.flatnonzero(moved <= SILENT * max(1.0, np.max(moved, initial=0.0))).tolist()


@dataclass(frozen=True, eq=False)
class NullSpace:
    """Null space: changes (k, d) of the parameters over their sizes without effect on a residual; resolved: whether sure."""

    changes: np.ndarray
    resolved: bool


def null_space(
    point: LocalJacobian, sizes: np.ndarray, finer: LocalJacobian | None = None, rounding: float = ROUNDING
) -> NullSpace:
    """Null space of the Jacobian; finer: Jacobian on a finer mesh, which differs where the mesh is too coarse;
    rounding: without it, what counts as zero.

    A small singular value is one of rounding, and its vector null, if the finer mesh does not confirm what it moves.
    """
    columns = point.jacobian * sizes
    norms = column_norms(columns)
    columns = columns / norms
    _, singular, right = np.linalg.svd(columns, full_matrices=False)
    null, resolved = [], True
    for value, vector in zip(singular, right, strict=True):
        if value > DOUBTFUL * singular[0]:
            continue
        if finer is None:
            silent = value <= rounding * singular[0]
        else:
            moved, again = columns @ vector, (finer.jacobian * sizes / norms) @ vector
            silent = np.linalg.norm(again - moved) > CONFIRMED * value
            resolved = resolved and not (silent and np.linalg.norm(again) > ROUNDING * singular[0])
            silent = silent or value <= np.finfo(float).eps * singular[0]
        if silent:
            null.append(vector)
    return NullSpace(np.array(null).reshape(len(null), sizes.size).T / norms[:, None], resolved)


def local_messages(
    names: Sequence[str],
    point: LocalJacobian,
    sizes: np.ndarray,
    finer: LocalJacobian | None,
    elsewhere: Callable[[], LocalJacobian | None],
) -> list[str]:
    """Message for each indistinguishable group of a nonlinear fit; elsewhere: the Jacobian at another point."""
    changes = _sparse_changes(point, sizes, null_space(point, sizes, finer).changes)
    if not changes:
        return []
    other, again = elsewhere(), {}
    if other is not None:
        again = _sparse_changes(other, sizes, null_space(other, sizes, rounding=NEARLY).changes)
    found = []
    for mine, change in changes.items():
        own, points = [names[k] for k in mine], [(change, point.values[list(mine)])]
        if other is not None and mine in again:
            points.append((again[mine], other.values[list(mine)]))
        law = _law(own, points) if other is None or len(points) == 2 else []
        found.append(not_told_apart(own, law or _to_first_order(own, change)))
    return found


def _sparse_changes(
    point: LocalJacobian, sizes: np.ndarray, null: np.ndarray
) -> dict[tuple[int, ...], np.ndarray]:
    """Sparse basis of the span of `null` (k, d), each vector by the indices of its parameters."""
    if not null.shape[1]:
        return {}
    norms = np.linalg.norm(point.jacobian * sizes, axis=0)
    null = null * norms[:, None]
    pivots = cast(Any, qr(null.T, pivoting=True, mode="r"))[1][: null.shape[1]]
    null = null @ np.linalg.inv(null[pivots])
    null[np.abs(null) < 1e-5] = 0.0
    changes = null / norms[:, None] * sizes[:, None]
    return {tuple(np.flatnonzero(c).tolist()): c[np.flatnonzero(c)] for c in changes.T}


def _law(names: list[str], points: list[tuple[np.ndarray, np.ndarray]]) -> list[str]:
    """Simple invariants of changes of these parameters; points: changes and values."""
    if len(names) == 2:
        return [law] if (law := _pair(names, points)) else []
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = np.array([change / value for change, value in points])
        alike = np.allclose(relative / relative[:, :1], 1.0, atol=SURE)
    return [f"{name} / {names[0]}" for name in names[1:]] if alike else []


def _to_first_order(names: list[str], change: np.ndarray) -> list[str]:
    """Sums invariant under small changes."""
    others = np.arange(len(names) - 1)
    base = BaseParameters(others, others[-1:] + 1, -(change[:-1] / change[-1])[:, None])
    return [f"{one} (to first order)" for one in base.words(names)]


def _pair(names: list[str], points: list[tuple[np.ndarray, np.ndarray]]) -> str:
    """Determined ratio, product, difference or sum of two parameters; "" for none of these."""
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = np.array([(c / v)[1] / (c / v)[0] for c, v in points])  # d ln b / d ln a
        absolute = np.array([c[1] / c[0] for c, _ in points])
        a, b = names
        if np.all(np.abs(relative) < 1 - SURE):  # so that the exponent is not below one
            a, b, relative = b, a, 1 / relative
    for power, text in EXPONENTS.items():
        for sign, word in ((1, "/"), (-1, "*")):
            if np.all(np.abs(relative - sign * power) < SURE):
                return f"{b} {word} {a}{text}" if text else f"{names[0]} {word} {names[1]}"
    if np.all(np.abs(absolute - 1) < SURE):
        return f"{names[0]} - {names[1]}"
    return f"{names[0]} + {names[1]}" if np.all(np.abs(absolute + 1) < SURE) else ""
