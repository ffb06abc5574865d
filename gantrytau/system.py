"""The sorted blocks put together as one semi-explicit system, with what has no closed form left implicit."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import casadi as ca

from gantrytau.symbols import split_derivative

if TYPE_CHECKING:
    from gantrytau.dae import Dae


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

    dae: "Dae"
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

    @cached_property
    def closed_algebraics(self) -> ca.SX | None:
        """All algebraics in closed form of (time, x, u, p), or None if some have none."""
        closed = [a.closed for a in self.algebraics if a.closed is not None]
        if len(closed) < len(self.algebraics):
            return None
        if not closed:
            return ca.SX(0, 1)
        found, _ = ca.substitute_inplace([a.symbol for a in self.algebraics], closed, [ca.SX(0)], False)
        return ca.vertcat(*found)


def _cumulative(sizes) -> list[int]:
    total, found = 0, []
    for size in sizes:
        total += size
        found.append(total)
    return found


def assemble(dae: "Dae", form: Literal["explicit", "lifted"]) -> System:
    """Put the blocks of a Dae together; see Dae.system."""
    chains = dae.reduced.chains
    definitions: list[tuple[ca.SX, ca.SX]] = []
    algebraics: list[Algebraic] = []
    for block in dae.blocks:
        keep = (
            form == "lifted" and block.kind in ("quadratic", "linear", "spheres") and len(block.unknowns) > 0
        )
        if block.solution is None:
            algebraics += [
                Algebraic(y.name(), y, r, None) for y, r in zip(block.tears, block.residuals, strict=True)
            ]
        elif keep and block.root is not None:
            # s = middle + side * w with w^2 = radicand, w >= 0: no square root to differentiate at zero
            name = f"sqrt({block.tears[0].name()})"
            w = ca.SX.sym(name)
            algebraics.append(
                Algebraic(name, w, w**2 - block.root.radicand, ca.sqrt(ca.fmax(block.root.radicand, 0)), 0.0)
            )
            definitions.append((block.tears[0], block.root.middle + block.root.side * w))
        elif keep and len(block.tears) > 1:
            algebraics += [
                Algebraic(y.name(), y, r, s)
                for y, r, s in zip(block.tears, block.residuals, block.solution, strict=True)
            ]
        else:
            definitions += zip(block.tears, block.solution, strict=True)
        definitions += block.inner
    states = dae.choice.states
    derivatives = []
    for name in states:
        base, order = split_derivative(name)
        derivatives.append(chains.sx(base, order + 1))
    ode = ca.vertcat(*derivatives) if derivatives else ca.SX(0, 1)
    residuals = ca.vertcat(*(a.residual for a in algebraics)) if algebraics else ca.SX(0, 1)
    draft = System(
        dae=dae,
        time=dae.flat.time,
        states=dae.states,
        x=ca.vertcat(*(chains.named(n) for n in states)) if states else ca.SX(0, 1),
        algebraics=tuple(algebraics),
        z=ca.vertcat(*(a.symbol for a in algebraics)) if algebraics else ca.SX(0, 1),
        inputs=dae.known,
        u=ca.vertcat(*(chains.sx(n) for n in dae.known)) if dae.known else ca.SX(0, 1),
        parameters=dae.table.independent,
        p=ca.vertcat(*(dae.table.symbols[n] for n in dae.table.independent))
        if dae.table.independent
        else ca.SX(0, 1),
        definitions=tuple(definitions),
        ode=ode,
        residuals=residuals,
    )
    closed = [a.closed for a in algebraics if a.closed is not None]
    ode, residuals, *closed = draft.resolve([ode, residuals, *closed])
    given = iter(closed)
    resolved = tuple(
        Algebraic(a.name, a.symbol, residuals[i], None if a.closed is None else next(given), a.min)
        for i, a in enumerate(algebraics)
    )
    return System(
        **{
            **{k: getattr(draft, k) for k in draft.__dataclass_fields__},
            "ode": ode,
            "residuals": residuals,
            "algebraics": resolved,
        }
    )
