"""The sorted blocks put together as one semi-explicit system, with what has no closed form left implicit."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import casadi as ca
import numpy as np

from gantrytau.compiler.alphabets import Substitution, column
from gantrytau.compiler.translated import Translated


@dataclass(frozen=True, eq=False)
class Algebraic:
    """An unknown of the algebraic equations: name, symbol, residual, bounds, and its closed form if it has one.

    closed: expression of the system's other symbols that gives it outright, for first guesses; or None.
    """

    name: str
    symbol: ca.SX
    residual: ca.SX
    closed: ca.SX | None
    min: float = -float("inf")


@dataclass(frozen=True, eq=False)
class System:
    """x' = ode, 0 = residuals, all in SX of (time, x, z, u, p).

    definitions: (symbol, expression) in order of solution, through which every variable can be expressed.
    """

    dae: Translated
    time: ca.SX
    states: tuple[str, ...]
    x: ca.SX
    algebraics: tuple[Algebraic, ...]
    z: ca.SX
    inputs: tuple[str, ...]
    u: ca.SX
    parameters: tuple[str, ...]
    p: ca.SX
    definitions: tuple[tuple[ca.SX, ca.SX], ...]
    ode: ca.SX
    residuals: ca.SX

    def to_system(self, expressions: Sequence[ca.SX]) -> list[ca.SX]:
        """Expressions in reduced symbols as expressions of (time, x, z, u, p) and derivatives of inputs."""
        dense = [ca.densify(e) for e in expressions]
        (found,) = Substitution(self.definitions).inserted([column([ca.vec(e) for e in dense])])
        pieces = ca.vertsplit(found, np.cumsum([0, *(e.numel() for e in dense)]).tolist())
        return [ca.reshape(piece, *e.shape) for piece, e in zip(pieces, dense, strict=True)]


def assemble(dae: Translated, form: Literal["explicit", "lifted"]) -> System:
    """Put the blocks of a Dae together; see Dae.system."""
    chains, table = dae.reduced.chains, dae.table
    definitions, algebraics = _left_implicit(dae, form)
    draft = System(
        dae=dae,
        time=dae.flat.time,
        states=dae.states,
        x=column([chains.named(n) for n in dae.choice.states]),
        algebraics=tuple(algebraics),
        z=column([a.symbol for a in algebraics]),
        inputs=dae.known,
        u=column([chains.sx(n) for n in dae.known]),
        parameters=table.independent,
        p=column([table.symbols[n] for n in table.independent]),
        definitions=tuple(definitions),
        ode=column([chains.rate(n) for n in dae.choice.states]),
        residuals=column([a.residual for a in algebraics]),
    )
    closed = [a.closed for a in algebraics if a.closed is not None]
    ode, residuals, *closed = draft.to_system([draft.ode, draft.residuals, *closed])
    given = iter(closed)
    resolved = tuple(
        replace(a, residual=residuals[i], closed=None if a.closed is None else next(given))
        for i, a in enumerate(algebraics)
    )
    return replace(draft, ode=ode, residuals=residuals, algebraics=resolved)


def _left_implicit(
    dae: Translated, form: Literal["explicit", "lifted"]
) -> tuple[list[tuple[ca.SX, ca.SX]], list[Algebraic]]:
    """What the blocks define outright, in order, and what stays as an equation."""
    definitions: list[tuple[ca.SX, ca.SX]] = []
    algebraics: list[Algebraic] = []
    for block in dae.blocks:
        count = len(block.tears)
        solution: Sequence[ca.SX | None] = block.solution or [None] * count
        several = count > 1 and block.kind in ("linear", "spheres")
        if form == "lifted" and block.root is not None:
            # no square root to differentiate at zero
            w, radicand = block.root.root, block.root.radicand
            algebraics.append(Algebraic(w.name(), w, w**2 - radicand, ca.sqrt(ca.fmax(radicand, 0)), 0.0))
            definitions.append((block.tears[0], block.root.value))
        elif block.solution is None or (form == "lifted" and several):
            rows = zip(block.tears, block.residuals, solution, strict=True)
            algebraics += [Algebraic(y.name(), y, residual, closed) for y, residual, closed in rows]
        else:
            definitions += zip(block.tears, block.solution, strict=True)
        definitions += block.inner
    return definitions, algebraics
