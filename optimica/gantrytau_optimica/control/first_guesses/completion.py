"""First guesses that agree with the model: what no closed form gives is found along the guess of the rest.

    0 = r(t, x, z, u)          z by Newton's method, block after block, from one time to the next

Each time begins where the one before ended, the first one where the model starts, so that mechanisms stay assembled as they
are there. A step is halved where Newton's corrections do not shrink as they do near a solution (Deuflhard, Newton Methods
for Nonlinear Problems, 2004, section 2.1): a longer one might end on another branch. In inverse causality accelerations
are the slopes of the guessed speeds, and the inputs are what moves the mechanism so.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau.compiler.dulmage_mendelsohn import decompose
from gantrytau.language.symbols import split_derivative
from gantrytau_optimica.control.control_problem import Phase, Signal

MOST_CORRECTIONS = 12
SHRINKING = 0.5  # of a correction: the next one is no larger near a solution
SMALL = 1e-10  # of the unknowns of a block: corrections that end the iteration
ROUNDING = 1e-6  # the same of corrections that rounding keeps from shrinking
MOST_HALVINGS = 10


@dataclass(frozen=True, eq=False)
class Driven:
    """Accelerations among the algebraics, and the inputs that are to follow from them, as signals of a phase.

    speeds: numbers of the states whose slopes the accelerations are.
    """

    rates: tuple[Signal, ...] = ()
    speeds: tuple[int, ...] = ()
    inputs: tuple[Signal, ...] = ()


def driven(phase: Phase, orders: Mapping[str, int]) -> Driven:
    """What moves a phase, where all its inputs could follow from as many accelerations; else nothing.

    orders: of the highest derivatives, by variable; lower ones, as rates of quaternions, are no accelerations.
    """
    algebraics = {a.symbol.element_hash(): a for a in phase.algebraics}
    found: list[tuple[int, Signal]] = []
    for k, (state, rate) in enumerate(zip(phase.states, phase.ode.elements(), strict=True)):
        base, order = split_derivative(state.symbol.name())
        if orders.get(base, 0) == order + 1 and rate.element_hash() in algebraics:
            found.append((k, algebraics[rate.element_hash()]))
    if len(found) != len(phase.inputs):
        return Driven()
    return Driven(tuple(a for _, a in found), tuple(k for k, _ in found), phase.inputs)


class Completion:
    """Values of the unknowns of a phase that solve its equations where the others are known."""

    def __init__(
        self,
        residuals: ca.SX,
        knowns: ca.SX,
        unknowns: ca.SX,
        closed: Mapping[int, ca.SX],
    ):
        """knowns: symbols of all that is known; unknowns: as many symbols as there are residuals; closed: what gives an
        unknown outright, by its place, as a square root.
        """
        rows, columns = ca.jacobian_sparsity(residuals, unknowns).get_triplet()
        pattern: list[list[int]] = [[] for _ in range(residuals.numel())]
        for i, j in zip(rows, columns, strict=True):
            pattern[i].append(j)
        found = decompose(pattern, unknowns.numel())
        self.determined = not (found.surplus or found.undetermined)
        self.blocks: list[NewtonBlock] = []
        for own, places in found.blocks:
            outright = closed.get(places[0]) if len(places) == 1 else None
            r, x = residuals[list(own)], unknowns[list(places)]
            results = [r, ca.jacobian(r, x)] if outright is None else [outright]
            function = ca.Function("block", [knowns, unknowns], [ca.densify(e) for e in results])
            self.blocks.append(NewtonBlock(function, np.array(places), outright is not None))

    def along(self, begin: np.ndarray, start: np.ndarray, knowns: np.ndarray) -> np.ndarray:
        """Unknowns (k, n) at values of what is known (n, m), from those at the start, (k,), with what is known there, (m,).

        NaN from where no solution is found.
        """
        newton = Newton(self.blocks, begin.size, start.size)
        found = np.full((len(knowns), start.size), np.nan)
        here, y = begin, start
        for k, there in enumerate(knowns):
            reached = newton.moved(here, there, y, MOST_HALVINGS)
            if reached is None:
                break
            here, y = there, reached
            found[k] = y
        return found


@dataclass(frozen=True, eq=False)
class NewtonBlock:
    """(known, unknowns) -> residuals and their Jacobian by the unknowns at `places`, or outright their only value."""

    function: ca.Function
    places: np.ndarray
    outright: bool


class Newton:
    """Newton's method, block after block, on arrays that CasADi reads and writes in place."""

    def __init__(self, blocks: Sequence[NewtonBlock], known: int, unknowns: int):
        self.known, self.y = np.zeros(known), np.zeros(unknowns)
        self.calls = []
        for block in blocks:
            shapes = [block.function.size_out(i) for i in range(block.function.n_out())]
            results = [np.zeros(rows * columns) for rows, columns in shapes]
            buffer, evaluate = block.function.buffer()
            for i, argument in enumerate((self.known, self.y)):
                buffer.set_arg(i, argument.data)
            for i, result in enumerate(results):
                buffer.set_res(i, result.data)
            results = [x.reshape(shape, order="F") for x, shape in zip(results, shapes, strict=True)]
            self.calls.append((block, buffer, evaluate, results))

    def moved(self, here: np.ndarray, there: np.ndarray, y: np.ndarray, halvings: int) -> np.ndarray | None:
        """The unknowns there, from those here, in as many steps as it takes; None where they are not found."""
        found = self._solved(there, y)
        if found is not None or not halvings:
            return found
        middle = 0.5 * (here + there)
        half = self.moved(here, middle, y, halvings - 1)
        return None if half is None else self.moved(middle, there, half, halvings - 1)

    def _solved(self, known: np.ndarray, y: np.ndarray) -> np.ndarray | None:
        self.known[:], self.y[:] = known, y
        for block, _, evaluate, results in self.calls:
            if block.outright:
                evaluate()
                self.y[block.places] = results[0].item()
            elif not self._corrected(block.places, evaluate, *results):
                return None
        return self.y.copy() if np.all(np.isfinite(self.y)) else None

    def _corrected(
        self, places: np.ndarray, evaluate: Callable[[], None], r: np.ndarray, jacobian: np.ndarray
    ) -> bool:
        """Whether Newton's method solves one block, in place."""
        before = np.inf
        for _ in range(MOST_CORRECTIONS):
            evaluate()
            if not (np.isfinite(r).all() and np.isfinite(jacobian).all()):
                return False
            try:
                step = np.linalg.solve(jacobian, r)[:, 0]
            except np.linalg.LinAlgError:
                return False
            self.y[places] -= step
            size = math.sqrt(step @ step)
            length = math.sqrt(self.y[places] @ self.y[places])
            if size <= SMALL * length or size == 0.0:
                return True
            if size > SHRINKING * before:
                return size <= ROUNDING * length
            before = size
        return False
