"""The sorted blocks put together as one semi-explicit system, with what has no closed form left implicit."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import casadi as ca

from gantrytau.compiler.translated import Translated
from gantrytau.language.symbols import split_derivative


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

    def express(self, expressions: Sequence[ca.SX]) -> list[ca.SX]:
        """Expressions of the model's symbols as expressions of (time, x, z, u, p) and input derivatives."""
        return self.resolve([self.dae.reduce(e) for e in expressions])

    def resolve(self, expressions: Sequence[ca.SX]) -> list[ca.SX]:
        """Like `express`, for expressions in the reduced symbols."""
        vector = ca.vertcat(*(ca.vec(ca.densify(e)) for e in expressions))
        (_, (found,)) = self._inserted((vector,))
        pieces = ca.vertsplit(found, [0, *_cumulative(e.numel() for e in expressions)])
        return [ca.reshape(piece, *e.shape) for piece, e in zip(pieces, expressions, strict=True)]

    def _inserted(self, expressions: Sequence[ca.SX]):
        symbols = [v for v, _ in self.definitions]
        values = [e for _, e in self.definitions]
        return (
            ca.substitute_inplace(symbols, values, list(expressions), False) if symbols else ((), expressions)
        )


def _cumulative(sizes) -> list[int]:
    total, found = 0, []
    for size in sizes:
        total += size
        found.append(total)
    return found


def assemble(dae: Translated, form: Literal["explicit", "lifted"]) -> System:
    """Put the blocks of a Dae together; see Dae.system."""
    chains, table = dae.reduced.chains, dae.table
    definitions, algebraics = _left_implicit(dae, form)
    rates = [chains.sx(base, order + 1) for base, order in map(split_derivative, dae.choice.states)]
    draft = System(
        dae=dae,
        time=dae.flat.time,
        states=dae.states,
        x=_column([chains.named(n) for n in dae.choice.states]),
        algebraics=tuple(algebraics),
        z=_column([a.symbol for a in algebraics]),
        inputs=dae.known,
        u=_column([chains.sx(n) for n in dae.known]),
        parameters=table.independent,
        p=_column([table.symbols[n] for n in table.independent]),
        definitions=tuple(definitions),
        ode=_column(rates),
        residuals=_column([a.residual for a in algebraics]),
    )
    closed = [a.closed for a in algebraics if a.closed is not None]
    ode, residuals, *closed = draft.resolve([draft.ode, draft.residuals, *closed])
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
            # s = middle + side * w with w^2 = radicand, w >= 0: no square root to differentiate at zero
            name, root = f"sqrt({block.tears[0].name()})", block.root
            w = ca.SX.sym(name)
            algebraics.append(
                Algebraic(name, w, w**2 - root.radicand, ca.sqrt(ca.fmax(root.radicand, 0)), 0.0)
            )
            definitions.append((block.tears[0], root.middle + root.side * w))
        elif block.solution is None or (form == "lifted" and several):
            rows = zip(block.tears, block.residuals, solution, strict=True)
            algebraics += [Algebraic(y.name(), y, residual, closed) for y, residual, closed in rows]
        else:
            definitions += zip(block.tears, block.solution, strict=True)
        definitions += block.inner
    return definitions, algebraics


def _column(elements: Sequence[ca.SX]) -> ca.SX:
    return ca.vertcat(*elements) if elements else ca.SX(0, 1)
