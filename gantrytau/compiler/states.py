"""Choice of states: dummy derivatives as a greedy weighted basis on numbers.

Mattsson and Söderlind, SIAM J. Sci. Comput. 14, 1993: where a constraint was differentiated, as many
derivatives become plain unknowns. Which ones is decided on the Jacobian at a consistent point, the least
preferred variables first, so that the choice cannot be singular there.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau.border.refusal import Given, StructureError
from gantrytau.compiler.aliases import Reduced
from gantrytau.compiler.index_reduction import Indexed
from gantrytau.compiler.refusals import dependent
from gantrytau.compiler.start.balance import balance
from gantrytau.compiler.start.newton import DENSE
from gantrytau.compiler.symbol_spaces import values_at
from gantrytau.language.declarations import StateSelect
from gantrytau.language.symbols import derivative_name, split_derivative

GOOD_PIVOT = 0.05  # of the column before elimination: smaller ones wait for a better preferred variable
LEAST_PIVOT = 1e-9
ILL = 1e3  # condition of a choice from which on it is gone through once more: those of most robots are below 600
MOST_WORSE = 10.0  # times the condition: what a better preferred state may cost
SCALINGS = 20
LAST = StateSelect.ALWAYS + 1  # the weight of what the caller asks for


@dataclass(frozen=True)
class StateChoice:
    """states: names, in order; condition: of the choice."""

    states: tuple[str, ...]
    condition: float


def choose_states(
    indexed: Indexed,
    reduced: Reduced,
    sample: Mapping[str, float],
    preference: Mapping[str, int],
    wanted: Sequence[str],
    title: str,
) -> StateChoice:
    """States of the index-reduced system.

    sample: consistent numbers; preference: StateSelect by variable; wanted: names the caller asks for.
    Raises StructureError if a wanted or compulsory state cannot be one, or the equations are singular.
    """
    dummies: set[str] = set()
    condition = 1.0
    allowed: list[str] = [n for n, top in indexed.orders.items() if top >= 1]
    for level in range(1, max(indexed.counts, default=0) + 1):
        rows = [i for i, count in enumerate(indexed.counts) if count >= level]
        columns = [n for n in allowed if indexed.orders[n] >= level]
        matrix = _constraints(indexed, reduced, sample, rows, columns, allowed)
        chosen, conditioned = _basis(reduced, matrix, preference, wanted, rows, columns, title)
        condition = max(condition, conditioned)
        dummies |= {derivative_name(n, indexed.orders[n] - level) for n in chosen}
        allowed = chosen
    states = tuple(
        derivative_name(n, order)
        for order in range(max(indexed.orders.values(), default=0))
        for n, top in indexed.orders.items()
        if order < top and derivative_name(n, order) not in dummies
    )
    missing = [n for n in wanted if n not in states]
    if missing:
        words = (
            f"{missing[0]} cannot be a state together with the others asked for; the states of this model can be "
            f"{', '.join(states)} ({len(states)} in all). Name other variables in "
        )
        raise StructureError(words, Given("states"), ", or fewer", place=title, argument="states")
    return StateChoice(states, condition)


def _basis(reduced, matrix, preference, wanted, rows, columns, title) -> tuple[list[str], float]:
    """Which variables become dependent: as many as there are rows, the least preferred first."""
    sizes_of_rows, sizes_of_columns = balance(matrix)
    matrix = sizes_of_rows * matrix * sizes_of_columns
    matrix = matrix / np.maximum(np.linalg.norm(matrix, axis=1, keepdims=True), 1e-300)
    asked = {split_derivative(n)[0] for n in wanted}
    weights = [LAST if n in asked else int(preference.get(n, StateSelect.DEFAULT)) for n in columns]
    groups: dict[int, list[int]] = {}
    for place in range(len(columns)):
        groups.setdefault(weights[place], []).append(place)
    norms = np.linalg.norm(matrix, axis=0)
    rest, sizes = matrix.copy(), norms.copy()
    chosen: list[int] = []
    rounds = [(GOOD_PIVOT, w) for w in sorted(groups) if w <= StateSelect.ALWAYS]
    rounds += [(LEAST_PIVOT, w) for w in sorted(groups)]  # what is asked for is given up last
    for least, weight in rounds:
        candidates = np.setdiff1d(groups[weight], chosen).astype(int)
        while len(chosen) < len(rows) and candidates.size:
            best = int(np.argmax(sizes[candidates]))
            column = int(candidates[best])
            if not sizes[column] > least * max(norms[column], 1e-12):
                break
            candidates = np.delete(candidates, best)
            _project(rest, sizes, column)
            chosen.append(column)
    if len(chosen) < len(rows):
        raise dependent(title, [reduced.equations[i] for i in rows], matrix, LEAST_PIVOT)
    condition = _condition(matrix[:, chosen])
    if condition > ILL:
        chosen = _exchanged(matrix, chosen, weights)
        condition = _condition(matrix[:, chosen])
    return [columns[j] for j in sorted(chosen)], condition


def _constraints(indexed, reduced, sample, rows, columns, allowed) -> np.ndarray:
    """The derivatives of constraints by coordinates.

    A function may give its derivative by another variable, as a rotation matrix by the angular velocity: what that is of
    the coordinates, the equations say that are differentiated less often.
    """

    def highest(names: Sequence[str]) -> ca.SX:
        return ca.vertcat(*(reduced.chains.sx(n, indexed.orders[n]) for n in names))

    x, y = highest(columns), highest([n for n in allowed if n not in set(columns)])
    f = ca.vertcat(*(indexed.residuals[i, indexed.counts[i]] for i in rows))
    matrix = values_at(ca.jacobian(f, x), sample)
    if y.is_empty() or not ca.depends_on(f, y):
        return matrix
    others = [i for i, count in enumerate(indexed.counts) if count and i not in set(rows)]
    g = ca.vertcat(*(indexed.residuals[i, indexed.counts[i]] for i in others))
    by_x, by_y = (values_at(ca.jacobian(g, one), sample) for one in (x, y))
    return matrix - values_at(ca.jacobian(f, y), sample) @ np.linalg.lstsq(by_y, by_x)[0]


def _project(rest: np.ndarray, sizes: np.ndarray, column: int) -> None:
    """Take the direction of one column out of all others. Only columns with a row in common change."""
    direction = rest[:, column] / np.linalg.norm(rest[:, column])
    rows = np.flatnonzero(direction) if rest.size > DENSE else np.arange(len(rest))
    shares = direction[rows] @ rest[rows]
    touched = np.flatnonzero(shares)
    rest[np.ix_(rows, touched)] -= np.outer(direction[rows], shares[touched])
    sizes[touched] = np.linalg.norm(rest[:, touched], axis=0)


def _exchanged(matrix: np.ndarray, chosen: Sequence[int], weights: Sequence[int]) -> list[int]:
    """The dependent columns, where each that is more preferred than a state has changed places with it if it could.

    In a basis B a column a = B c stands in for the one with the largest of c, by which det(B) is multiplied. Which columns
    were left when others had been gone through depends on their order and sizes: a state that is hardly wanted may stay
    where one that is would do as well. Each change makes a state more preferred, so that they end.
    """
    basis = list(chosen)
    most = MOST_WORSE * _scaled_condition(matrix[:, basis])
    changed = True
    while changed:
        changed = False
        for state in sorted(set(range(len(weights))) - set(basis), key=lambda j: weights[j]):
            better = [k for k, j in enumerate(basis) if weights[j] > weights[state]]
            if not better:
                continue
            sizes = np.abs(np.linalg.lstsq(matrix[:, basis], matrix[:, state])[0])
            sizes *= np.linalg.norm(matrix[:, basis], axis=0)
            trial = list(basis)
            trial[max(better, key=lambda k: sizes[k])] = state
            if _scaled_condition(matrix[:, trial]) < most:
                basis, changed = trial, True
    return basis


def _condition(matrix: np.ndarray) -> float:
    """The ratio of the largest to the smallest singular value; parts that share no row or column have their own ones."""
    values = np.concatenate(
        [np.linalg.svd(part, compute_uv=False) for part in _parts(matrix)] or [np.ones(1)]
    )
    return float(values.max() / values.min())


def _parts(matrix: np.ndarray) -> list[np.ndarray]:
    """The blocks of a square matrix that share no row or column; a small matrix stays whole."""
    if matrix.size <= DENSE:
        return [matrix] if matrix.size else []
    from scipy.sparse import block_array, csr_array
    from scipy.sparse.csgraph import connected_components

    entries = csr_array(matrix)
    count, part = connected_components(block_array([[None, entries], [entries.T, None]]))
    rows, columns = np.split(part, 2)
    if np.any(np.bincount(rows, minlength=count) != np.bincount(columns, minlength=count)):
        return [matrix]
    return [matrix[np.ix_(rows == k, columns == k)] for k in range(count)]


def _scaled_condition(matrix: np.ndarray) -> float:
    """The condition where the largest entries of rows and columns are brought to one (Ruiz, RAL-TR-2001-034)."""
    for _ in range(SCALINGS):
        rows, columns = (np.sqrt(np.max(np.abs(matrix), axis=k, keepdims=True)) for k in (1, 0))
        if not (np.all(rows) and np.all(columns)):
            return np.inf
        matrix = matrix / rows / columns
    return float(np.linalg.cond(matrix))
