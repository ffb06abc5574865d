"""What guides symbolic choices: numbers at the consistent start and around it, and what was solved before.

A pivot that is large at one pose may vanish at another one; such a pivot must not be divided by. The
points are consistent as far as the blocks before have closed forms.
"""

from collections.abc import Collection, Mapping, Sequence

import casadi as ca
import numpy as np

from gantrytau.compiler.alphabets import Substitution, values_at

COUNT = 12
SPREAD = (
    0.5  # of the points about the start, relative to the values there, or absolute in SI where they are small
)


class Guide:
    """Numbers of expressions at the start and around it, while blocks are solved one after another.

    start: numbers of all symbols; parameters: names among them that stay as they are; states: their rates
    are what equations of motion are solved for in the end (names in `rates`). partners: by equation
    the variable that it was solved for at a lower derivative, "" if in a block without closed order. The
    pivot at all higher derivatives is the same, so dividing by it again adds no singularity.
    """

    def __init__(self, start: Mapping[str, float], parameters: Collection[str], states: Sequence[str]):
        self.start = start
        self.parameters = parameters
        self.rates = frozenset(f"der({name})" for name in states)
        self.partners: dict[int, str] = {}
        self._solved: list[tuple[ca.SX, ca.SX]] = []

    def define(self, solved: Sequence[tuple[ca.SX, ca.SX]]) -> None:
        """From now on these symbols follow from others, as (symbol, expression) in order of solution."""
        self._solved += solved

    def at_start(self, expression: ca.SX) -> np.ndarray:
        """The numbers of an expression at the start, as a dense array."""
        return values_at(expression, self.start)

    def around(self, expression: ca.SX) -> np.ndarray:
        """The numbers of an expression at the start, then at points around it, (points, rows, columns)."""
        (resolved,) = Substitution(tuple(self._solved)).inserted([expression])
        leaves = ca.symvar(resolved)
        function = ca.Function("sample", [ca.vertcat(*leaves)], [ca.densify(ca.vec(resolved))])
        centre = np.array([self.start[leaf.name()] for leaf in leaves])
        moves = np.array([leaf.name() not in self.parameters for leaf in leaves], dtype=bool)
        steps = np.random.default_rng(0).uniform(-SPREAD, SPREAD, (len(leaves), COUNT))
        points = centre[:, None] + steps * (moves * np.maximum(np.abs(centre), 1.0))[:, None]
        found = np.array(function.map(COUNT)(points)).T.reshape(COUNT, *expression.shape[::-1])
        found = found.transpose(0, 2, 1)[np.isfinite(found).all(axis=(1, 2))]  # the others are out of reach
        return np.concatenate([self.at_start(expression)[None], found])


def reliable(entries: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """How large entries stay at all points relative to a reference; 0 where they change sign.

    entries: (points, ...); reference: of a shape that broadcasts with it.
    """
    same_sign = (entries > 0).all(axis=0) | (entries < 0).all(axis=0)
    return same_sign * (np.abs(entries) / np.maximum(reference, 1e-300)).min(axis=0)
