"""Cuts through the equations of a mechanism: some quantities are known, the blocks that follow are solved.

A mechanism has tool coordinates T, joint coordinates q and forces f, and dT, dq, ddT, ddq are their rates. The
equations that a cut leaves over are relations between what is known: constraints, and the balance of forces.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau.answers.function_through import Question, function_through, plain_function
from gantrytau.border.refusal import StructureError
from gantrytau.compiler.blocks.pattern import block_pattern
from gantrytau.compiler.blocks.solution import Block, SolvedBlocks
from gantrytau.compiler.index_reduction import Key
from gantrytau.compiler.symbol_spaces import column, values_at
from gantrytau.compiler.translated import Translated, carefully, solved
from gantrytau.language.symbols import derivative_name, split_derivative

ORDERS = {
    "T": ("T", 0),
    "dT": ("T", 1),
    "ddT": ("T", 2),
    "q": ("q", 0),
    "dq": ("q", 1),
    "ddq": ("q", 2),
    "f": ("f", 0),
}
EVERYTHING = tuple(ORDERS)
FOLLOWS = ("T", "q", "dT", "ddT")  # what passive coordinates and their rates follow from
GOOD_PIVOT = 0.05  # of an equation, what others leave of it: with less it waits for better ones
LEAST_PIVOT = 1e-9  # below, it says nothing new


@dataclass(frozen=True, eq=False)
class Cut:
    """Blocks solved from what is known; left: equations that are relations of known quantities.

    twins: relations of the same kind between coordinates that are aliases of each other.
    """

    strata: "Strata"
    kinds: tuple[str, ...]
    known: Mapping[str, ca.SX]
    blocks: SolvedBlocks
    left: tuple[Key, ...]
    twins: tuple[ca.SX, ...]

    @property
    def implicit(self) -> tuple[Block, ...]:
        """The blocks without closed form."""
        return self.blocks.implicit

    def in_known(self, expressions: Sequence[ca.SX]) -> list[ca.SX]:
        """The residuals of blocks without closed form, then the expressions, in what is known and what these blocks find."""
        dae = self.strata.dae
        known = [(dae.reduced.chains.named(n), e) for n, e in self.known.items()]
        (whole,) = self.blocks.after(known).inserted([column([*self.blocks.residuals, *expressions])])
        self._refuse_time(whole)
        return list(ca.densify(whole).elements())

    def _refuse_time(self, expression: ca.SX) -> None:
        dae = self.strata.dae
        if any(leaf.name() == dae.flat.time.name() for leaf in ca.symvar(expression)):
            raise StructureError(
                f"{dae.name}: its equations depend on time explicitly, expected a mechanism whose equations do not; make "
                "what varies an Input, which keeps its start value here"
            )

    def function(self, name: str, expressions: Sequence[ca.SX], *, by_value: bool) -> ca.Function:
        """Expressions as a function of the known quantities, one vector each, and of the parameters p.

        by_value: takes other pivots where those of the closed forms vanish; else these forms alone, as they are written.
        Where there is no solution its results are NaN.
        """
        strata, dae = self.strata, self.strata.dae

        def start() -> ca.DM:
            return ca.DM(np.concatenate([*map(strata.start, self.kinds), np.array(strata.numbers).ravel()]))

        question = Question(
            arguments=(*(strata.columns[k] for k in self.kinds), strata.p),
            start=start,
            known=tuple((dae.reduced.chains.named(n), e) for n, e in self.known.items()),
            targets=(column(list(expressions)),),
            names=((*self.kinds, "p"), ("value",)),
        )
        self._refuse_time(question.inserted(self.blocks))
        if not by_value:
            return plain_function(name, question, self.blocks, dae.start)
        return function_through(name, question, self.blocks, lambda: carefully(dae, self.blocks), dae.start)


class Strata:
    """The equations of a mechanism whose tool moves as a known function of time, ready to be cut.

    roles: scalar names of "T", "q" and "f". columns: symbols of these and their rates, named like the model's, and "s", the
    rates of passive coordinates that the balance needs; p: symbols of the parameters; numbers: their values;
    constraints: which equations relate T and q alone.
    """

    def __init__(self, dae: Translated, roles: Mapping[str, Sequence[str]]):
        self.dae, self.roles = dae, roles
        self.columns = {k: column([ca.SX.sym(n) for n in self.names(k)]) for k in EVERYTHING}
        self.p = column([dae.table.symbols[n] for n in dae.table.independent])
        self.numbers = ca.DM([dae.table.values[n] for n in dae.table.independent])
        self.constraints: frozenset[int] = frozenset()
        self.distance = self._distances()
        self.constraints = frozenset(i for i, _ in self.cut(("T", "q")).left)
        self.passive = self._passive()
        self.columns["s"] = column([ca.SX.sym(n) for n in self.passive])

    def names(self, kind: str) -> list[str]:
        """Scalar names of a kind: `der(x)` for rates."""
        if kind == "s":
            return list(self.passive)
        role, order = ORDERS[kind]
        return [derivative_name(n, order) for n in self.roles[role]]

    def start(self, kind: str) -> np.ndarray:
        """Values of a kind at the consistent start, (n,)."""
        return self.dae.numbers(self.names(kind), self.dae.start)

    def structural_zeros(self) -> tuple[ca.SX, ca.SX]:
        """Parameters that are zero by the way their vector follows from others, as gravity in x; and zeros for them."""
        table = self.dae.table
        found = [
            table.symbols[name]
            for vector in self.dae.flat.parameters
            if not all(value.is_constant() for value in vector.value)
            for name, value in zip(vector.elements, vector.value, strict=True)
            if name in table.independent and value.is_zero()
        ]
        return column(found), ca.SX.zeros(len(found))

    def cut(self, kinds: Sequence[str], find: str = "", why: str = "") -> Cut:
        """The blocks from `kinds` to `find`, or to the equations left over; `why`: opens the error if there is no way."""
        known, twins = self._known(kinds)
        residuals = self.dae.indexed.residuals
        unknowns = [n for n in self.dae.symbols if n not in known]
        left = self._left(unknowns)
        wanted = [self.dae.expression(n) for n in self.names(find)] if find else []
        wanted += [residuals[k] for k in left] if not find else []
        symbols = {s.name() for e in wanted for s in ca.symvar(e)} & set(unknowns)
        incidence = self.dae.indexed.incidence
        rest = {k: incidence[k] for k in sorted(incidence) if k not in left}
        pattern = block_pattern(rest, unknowns, sorted(symbols))
        if pattern.undetermined:
            raise StructureError(
                f"{self.dae.name}: {why or 'the equations left over have unknowns'}. Undetermined: "
                f"{', '.join(pattern.undetermined[:5])}. Expected tool, joints and forces that together describe the whole "
                "mechanism: name others"
            )
        return Cut(self, tuple(kinds), known, solved(self.dae, pattern), left, twins)

    def _passive(self) -> tuple[str, ...]:
        """Rates that the motion of the tool determines without any force, and that occur in the balance of forces."""
        dae = self.dae
        known, _ = self._known(FOLLOWS)
        unknowns = [n for n in dae.symbols if n not in known]
        left = self._left(unknowns)
        incidence, counts = dae.indexed.incidence, dae.indexed.counts
        motion = {k: row for k, row in incidence.items() if counts[k[0]] and k not in left}
        found = {n for _, names in block_pattern(motion, unknowns).blocks for n in names}
        forces = {x.name for k, row in incidence.items() if not counts[k[0]] for x in row}
        needed = forces - set(self._known(EVERYTHING)[0])
        return tuple(sorted(n for n in found & needed if split_derivative(n)[1]))

    def _left(self, unknowns: Sequence[str]) -> tuple[Key, ...]:
        """Equations that are not needed to find the unknowns: constraints first, then those far from the forces."""
        residuals, dae = self.dae.indexed.residuals, self.dae
        keys = sorted(residuals)
        whole = column([residuals[k] for k in keys])
        symbols = ca.symvar(whole)
        leaves = [s.name() for s in symbols]
        matrix = values_at(ca.jacobian(whole, column(symbols)), dae.start)
        last = max(self.distance.values()) + 1
        first, counts = -1 - max(dae.indexed.counts), dae.indexed.counts
        # positions, speeds and accelerations are found from what was differentiated; forces must not help out
        ranks = [
            last if i in self.constraints else first + times if counts[i] else self.distance[i, times]
            for i, times in keys
        ]
        places = [leaves.index(n) for n in unknowns if n in leaves]
        chosen = _independent(matrix[:, places], np.linalg.norm(matrix, axis=1), ranks)
        return tuple(k for i, k in enumerate(keys) if i not in chosen)

    def _known(self, kinds: Iterable[str]) -> tuple[dict[str, ca.SX], tuple[ca.SX, ...]]:
        """Expression of each known symbol; relations where two coordinates are the same one."""
        dae = self.dae
        known: dict[str, ca.SX] = {}
        twins: list[ca.SX] = []
        for kind in kinds:
            for name, argument in zip(self.names(kind), self.columns[kind].elements(), strict=True):
                alias = dae.root(name)
                assert alias is not None  # roles are variables
                symbol, value = alias.symbol, alias.root_value(argument)
                if symbol in known:
                    twins.append(value - known[symbol])
                else:
                    known[symbol] = value
        inputs = [n for n in dae.known if n not in known]
        for symbol in dae.symbols:
            base, order = split_derivative(symbol)
            if base in inputs and base not in {dae.reduced.aliases[n].root for n in self.roles["T"]}:
                known[symbol] = ca.SX(dae.start[symbol] if order == 0 else 0.0)
        return known, tuple(twins)

    def _distances(self) -> dict[Key, int]:
        """Distance of each equation from a force f, in equations, when all motion is known."""
        known, _ = self._known(EVERYTHING)
        forces = {s for s in self._known(["f"])[0] if split_derivative(s)[0] not in self.dae.known}
        found: dict[Key, int] = {}
        occurring = {k: {x.name for x in row} for k, row in self.dae.indexed.incidence.items()}
        rows = {k: row - (known.keys() - forces) for k, row in occurring.items()}
        reached, level = set(forces), 0
        while front := [k for k, row in rows.items() if k not in found and row & reached]:
            found.update(dict.fromkeys(front, level))
            reached |= {n for k in front for n in rows[k]}
            level += 1
        return {k: found.get(k, level) for k in rows}


def _independent(matrix: np.ndarray, sizes: np.ndarray, ranks: Sequence[int]) -> set[int]:
    """A largest set of independent rows, those of low rank first unless they lean on others; sizes: of whole rows."""
    norms = np.linalg.norm(matrix, axis=1)
    norms[norms <= LEAST_PIVOT * sizes] = 0.0  # nothing but rounding
    rest = matrix / np.where(norms > 0, norms, np.inf)[:, None]
    basis = np.empty((min(matrix.shape), matrix.shape[1]))
    chosen: set[int] = set()
    for least in (GOOD_PIVOT, LEAST_PIVOT):
        for rank in sorted(set(ranks)):
            candidates = [i for i in range(len(ranks)) if ranks[i] == rank and i not in chosen]
            while candidates:
                left = np.linalg.norm(rest[candidates], axis=1)
                best = int(np.argmax(left))
                if not left[best] > least:
                    break
                row = candidates.pop(best)
                # of what little is left of a row, much is rounding: once more across the others
                direction = rest[row] - basis[: len(chosen)].T @ (basis[: len(chosen)] @ rest[row])
                direction /= np.linalg.norm(direction)
                basis[len(chosen)] = direction
                chosen.add(row)
                rest -= np.outer(rest @ direction, direction)
    return chosen
