"""Ways to assemble a mechanism: other solutions of the equations of positions at the same states.

Two circles meet in two points, and a loop can be closed in several ways. The start values decide which one is
taken; the others are looked for from many first guesses.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau.compiler.blocks.solution import Block
from gantrytau.compiler.start.newton import newton
from gantrytau.compiler.translated import Translated
from gantrytau.describing.record import Record
from gantrytau.language.symbols import split_derivative

GUESSES = 40  # first guesses per block that has to be iterated
SAME = 1e-6  # difference of unknowns below which two solutions are one
LISTED = 3  # other solutions that are printed
MOST = 24  # unknowns of a block that is searched


@dataclass(frozen=True)
class Assembly(Record):
    """A group of unknowns with several solutions: what was taken, and what else there is, by name.

    The search from random guesses may miss some.
    """

    taken: Mapping[str, float]
    others: tuple[Mapping[str, float], ...]

    def __str__(self) -> str:
        def words(values: Mapping[str, float]) -> str:
            return ", ".join(f"{name} = {value:.6g}" for name, value in values.items())

        others = " or ".join(words(o) for o in self.others[:LISTED])
        more = f" or {len(self.others) - LISTED} more" if len(self.others) > LISTED else ""
        return (
            f"assembled with {words(self.taken)}; other ways at the same states: {others}{more} (start values near "
            "one choose it)"
        )


def assemblies(dae: Translated) -> tuple[Assembly, ...]:
    """Position equations with several solutions at the start."""
    units = {n: v.unit for v in dae.flat.variables for n in v.elements}
    found = []
    for block in dae.blocks:
        positions = all(split_derivative(n)[1] == 0 for n in block.unknowns)
        if (
            block.kind in ("quadratic", "spheres", "piecewise", "nonlinear")
            and positions
            and len(block.tears) <= MOST
        ):
            angles = np.array([units.get(n) == "rad" for n in block.unknowns])
            shown = _shown(block)
            taken = {dae.spoken(n): dae.start[n] for n in shown}
            others = [
                {dae.spoken(n): v for n, v in o.items() if n in shown} for o in _others(dae, block, angles)
            ]
            distinct = _distinct([taken, *others])[1:]
            if distinct:
                found.append(Assembly(taken, tuple(distinct)))
    return tuple(found)


def _distinct(solutions: list[dict[str, float]]) -> list[dict[str, float]]:
    found: list[dict[str, float]] = []
    for one in solutions:
        if all(any(abs(one[n] - other[n]) > SAME for n in one) for other in found):
            found.append(one)
    return found


def _shown(block: Block) -> list[str]:
    """The unknowns that describe a solution: joint coordinates rather than places of points."""
    chosen = [n for n in block.unknowns if "[" not in n.rsplit(".", 1)[-1]]
    return (chosen or list(block.unknowns))[:6]


def _others(dae: Translated, block: Block, angles: np.ndarray) -> list[dict[str, float]]:
    chains = dae.reduced.chains
    x = ca.vertcat(*(chains.named(n) for n in block.unknowns))
    f = ca.vertcat(*(dae.indexed.residuals[key] for key in block.equations))
    leaves = [leaf for leaf in ca.symvar(f) if leaf.name() not in set(block.unknowns)]
    numbers = ca.DM([dae.start[leaf.name()] for leaf in leaves])
    here = ca.substitute(f, ca.vertcat(*leaves), numbers) if leaves else f
    function = ca.Function("block", [x], [ca.densify(here), ca.densify(ca.jacobian(here, x))], {"cse": True})

    def at(point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        residual, jacobian = function(point)
        return np.array(residual).ravel(), np.array(jacobian)

    taken = np.array([dae.start[n] for n in block.unknowns])
    size = np.maximum(1.0, np.abs(taken))
    random = np.random.default_rng(0)
    solutions = [taken]
    for _ in range(GUESSES):
        guess = taken + np.where(angles, np.pi, 2.0 * size) * random.uniform(-1, 1, taken.size)
        point, residual, jacobian = newton(at, guess, np.ones(taken.size))
        scale = np.maximum(np.abs(jacobian) @ np.abs(point), 1.0)
        if not np.all(np.abs(residual) <= 1e-10 * scale):
            continue
        # an angle and the same a turn further are one solution
        point = np.where(angles, taken + np.remainder(point - taken + np.pi, 2 * np.pi) - np.pi, point)
        if all(np.max(np.abs(point - other)) > SAME * size.max() for other in solutions):
            solutions.append(point)
    return [dict(zip(block.unknowns, s.tolist(), strict=True)) for s in solutions[1:]]
