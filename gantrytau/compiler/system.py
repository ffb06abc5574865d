"""The sorted blocks put together as one semi-explicit system, with what has no closed form left implicit."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import casadi as ca

from gantrytau.border.refusal import Given, ModelError
from gantrytau.compiler.blocks.inverse_form import Inverse, SortedEquations, inverse_of, torn_of
from gantrytau.compiler.blocks.pivots import Guide
from gantrytau.compiler.blocks.solution import Block
from gantrytau.compiler.symbol_spaces import Substitution, column, together
from gantrytau.compiler.translated import Origin, Translated, origin_of

Causality = Literal["inverse", "forward"]


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

    definitions: (symbol, expression) in order of solution, through which every variable can be expressed; origins: of
    the algebraics; inverse: blocks that are solved for inputs, with accelerations among the algebraics; forward: why
    blocks that have a form of that kind in general have none here, in words.
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
    origins: tuple[Origin, ...]
    inverse: tuple[Inverse, ...]
    forward: tuple[str, ...]

    @property
    def orders(self) -> Mapping[str, int]:
        """Orders of the highest derivatives, by variable."""
        return self.dae.indexed.orders

    @property
    def loops(self) -> tuple[str, ...]:
        """Positions among the algebraics that close loops without closed form, and may do so in several ways."""
        orders = self.orders
        torn = (
            y.name() for b in self.dae.blocks if b.kind == "nonlinear" and b.solution is None for y in b.tears
        )
        return tuple(name for name in torn if orders.get(name, 0) >= 2)

    def to_system(self, expressions: Sequence[ca.SX]) -> list[ca.SX]:
        """Expressions in reduced symbols as expressions of (time, x, z, u, p) and derivatives of inputs."""
        return together(lambda whole: Substitution(self.definitions).inserted([whole])[0], expressions)


def assemble(
    dae: Translated, form: Literal["explicit", "lifted"], causality: Causality | None = None
) -> System:
    """Put the blocks of a Dae together; see Dae.system."""
    chains, table = dae.reduced.chains, dae.table
    left = _Left(dae, form)
    for one in _in_order(dae, form, causality, left.forward):
        if isinstance(one, Inverse):
            left.enter_inverse(one)
        else:
            left.enter(one)
    if causality == "inverse" and not left.inverse:
        why = f" ({'; '.join(left.forward)})" if left.forward else ""
        words = (
            f"but nothing has an inverse form here{why}, expected as many inputs that drive a mechanism as it has "
            "accelerations of states; leave it out"
        )
        raise ModelError(words, place=dae.name, found=Given("causality", causality))
    algebraics = left.algebraics
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
        definitions=tuple(left.definitions),
        ode=column([chains.rate(n) for n in dae.choice.states]),
        residuals=column([a.residual for a in algebraics]),
        origins=tuple(left.origins),
        inverse=tuple(left.inverse),
        forward=tuple(left.forward),
    )
    closed = [a.closed for a in algebraics if a.closed is not None]
    ode, residuals, *closed = draft.to_system([draft.ode, draft.residuals, *closed])
    given = iter(closed)
    resolved = tuple(
        replace(a, residual=residuals[i], closed=None if a.closed is None else next(given))
        for i, a in enumerate(algebraics)
    )
    return replace(draft, ode=ode, residuals=residuals, algebraics=resolved)


def _in_order(
    dae: Translated, form: Literal["explicit", "lifted"], causality: Causality | None, why: list[str]
) -> Iterator[Block | Inverse]:
    """The blocks in the order of their solution, inverse forms in the place of those they stand for.

    why: gets the reasons why blocks have none.
    """
    chains, inverse = dae.reduced.chains, dict[int, Inverse]()
    if form == "explicit" or causality == "forward":
        yield from dae.blocks
        return
    unknowns = [n for block in dae.blocks for n in block.unknowns]
    symbols = {n: chains.named(n) for n in (*unknowns, *dae.inputs)}
    every = SortedEquations(dae.blocks, dae.indexed.residuals, dae.indexed.incidence, symbols, dae.inputs)
    guide = partial(Guide, dae.start, dae.parameter_values, dae.choice.states)
    rates = guide().rates
    for number, block in enumerate(dae.blocks):
        wanted = causality == "inverse" or block.solution is None
        if not wanted or block.kind != "linear" or not rates & set(block.unknowns):
            continue
        found = inverse_of(every, number, guide)
        if isinstance(found, str):
            why.append(found)
        elif causality is None and found.tears >= found.forward:
            why.append(
                f"solved for forces, {found.tears} unknowns would be found together, forwards {found.forward}"
            )
        else:
            inverse[number] = found
    moved = {k for number, one in inverse.items() for k in one.members if k != number}
    done: set[int] = set()
    waiting: list[int] = []
    for number in range(len(dae.blocks)):
        waiting += [] if number in moved else [number]
        for k in list(waiting):
            own = inverse[k].members if k in inverse else {k}
            if set().union(*(every.needs[m] for m in own)) - own <= done:
                yield inverse.get(k, dae.blocks[k])
                done |= own
                waiting.remove(k)


class _Left:
    """What the blocks define outright, in order, and what stays as an equation."""

    def __init__(self, dae: Translated, form: Literal["explicit", "lifted"]):
        self.dae, self.form = dae, form
        self.definitions: list[tuple[ca.SX, ca.SX]] = []
        self.algebraics: list[Algebraic] = []
        self.origins: list[Origin] = []
        self.inverse: list[Inverse] = []
        self.forward: list[str] = []

    def enter(self, block: Block) -> None:
        """A block that is solved for its unknowns."""
        solution: Sequence[ca.SX | None] = block.solution or [None] * len(block.tears)
        if self.form == "lifted" and block.root is not None:
            # no square root to differentiate at zero
            w, inside = block.root.root, block.root.radicand
            self.algebraics.append(Algebraic(w.name(), w, w**2 - inside, ca.sqrt(ca.fmax(inside, 0)), 0.0))
            self.definitions.append((block.tears[0], block.root.value))
        elif block.solution is None or (self.form == "lifted" and torn_of(block)):
            rows = zip(block.tears, block.residuals, solution, strict=True)
            self.algebraics += [Algebraic(y.name(), y, residual, closed) for y, residual, closed in rows]
        else:
            self.definitions += zip(block.tears, block.solution, strict=True)
        self.definitions += block.inner
        self.origins.append(origin_of(self.dae, block))

    def enter_inverse(self, inverse: Inverse) -> None:
        """A block that is solved for inputs: an equation for each of them belongs to an acceleration."""
        named, inputs = self.dae.reduced.chains.named, set(inverse.inputs)
        place = len(self.algebraics)
        rows: list[tuple[ca.SX, Origin]] = []
        for block in inverse.blocks:
            origin = origin_of(self.dae, block)
            self.origins.append(origin)
            torn, closed = torn_of(block), block.solution or [None] * len(block.tears)
            if torn:
                for y, residual, form in zip(torn, block.residuals, closed, strict=True):
                    if y.name() in inputs:
                        rows.append((residual, origin))
                    else:
                        self.algebraics.append(Algebraic(y.name(), y, residual, form))
            outright = block.inner if torn else block.definitions
            rows += [(u - e, origin) for u, e in outright if u.name() in inputs]
            self.definitions += [(y, e) for y, e in outright if y.name() not in inputs]
        found = [
            Algebraic(name, named(name), row, None)
            for name, (row, _) in zip(inverse.rates, rows, strict=True)
        ]
        self.algebraics[place:place] = found
        self.origins += [
            replace(origin, tears=(name,), inner=())
            for name, (_, origin) in zip(inverse.rates, rows, strict=True)
        ]
        self.inverse.append(inverse)
