"""What of a translated model is written: all of it, or only what the wanted names depend on.

Wanted are the names in `find=` of the translation. What they depend on is followed backwards through the blocks to what
is known and to the states, which are taken as known: `find` means here what it means for a function.
"""

from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace

import casadi as ca

from gantrytau.compiler.translated import Translated
from gantrytau.language.statements import Equation
from gantrytau.language.symbols import split_derivative
from gantrytau.writing.instants_written import AtInstants, at_instants, without_pre
from gantrytau.writing.sections import Section, sections, symbol_names


@dataclass(frozen=True, eq=False)
class Excerpt:
    """The parts of a translated model that are written.

    sections: blocks, in the order of their solution; answers: what names are that no block gives by that name: wanted ones,
    and those that statements on instants read; instants: these; equations: of the flat model; known, states: names, the
    latter with the symbols that stand for them; asked: what is wanted, by the names that were asked for, with their scalars,
    nothing where everything is written; wanted: all these scalars; of: how many blocks there are; held: names that are set
    at instants.
    """

    sections: tuple[Section, ...]
    answers: tuple[tuple[str, ca.SX], ...]
    instants: tuple[AtInstants, ...]
    equations: tuple[Equation, ...]
    known: tuple[str, ...]
    states: tuple[tuple[str, str], ...]
    asked: tuple[tuple[str, tuple[str, ...]], ...]
    wanted: tuple[str, ...]
    of: int
    held: tuple[str, ...] = ()

    @property
    def left_out(self) -> str:
        """How much is left out, in words; "" for nothing."""
        count = len(self.sections)
        if not self.wanted or count == self.of:
            return ""
        plural = "" if self.of == 1 else "s"
        return f"{count} of {self.of} block{plural}; the others do not matter for what is wanted"

    def remark(self, scalars: Collection[str]) -> str:
        """What there is to say of wanted scalars that are no results: "known", "set at instants", "a state", or ""."""
        states = {name for state in self.states for name in state}
        kinds = {"set at instants": {*self.held}, "known": {*self.known, "time"}, "a state": states}
        return next((words for words, names in kinds.items() if names.issuperset(scalars)), "")


def excerpt(dae: Translated) -> Excerpt:
    """What of a translated model is written."""
    every, instants = sections(dae), at_instants(dae.flat)
    wanted = tuple(dict.fromkeys(n for name in dae.request.find for n in dae.expand(name)))
    states = tuple(zip(dae.states, dae.choice.states, strict=True))
    if not wanted:
        equations = dae.flat.equations
        return Excerpt(tuple(every), (), instants, equations, dae.known, states, (), (), len(every))
    needs = _Needs(dae, wanted, every, instants)
    given = {n for name in dae.request.given for n in dae.expand(name)}
    return Excerpt(
        sections=tuple(replace(s, number=k) for k, s in enumerate(needs.sections, start=1)),
        answers=needs.answers,
        instants=needs.instants,
        equations=needs.equations(),
        known=tuple(n for n in dae.known if n in needs.used or n in given),
        states=tuple((name, symbol) for name, symbol in states if symbol in needs.used),
        asked=tuple((name, dae.expand(name)) for name in dict.fromkeys(dae.request.find)),
        wanted=wanted,
        of=len(every),
        held=dae.flat.event_names,
    )


class _Needs:
    """What some names depend on."""

    def __init__(
        self,
        dae: Translated,
        wanted: Collection[str],
        every: Iterable[Section],
        instants: Iterable[AtInstants],
    ):
        self.dae, self.wanted = dae, wanted
        self.used: set[str] = set()  # reduced symbols
        every, instants = list(every), list(instants)
        givers = {n: section for section in every for n in section.unknowns}
        asked = dict.fromkeys(wanted)
        taken: set[Section | AtInstants] = set()
        pending = [leaf for name in wanted for leaf in symbol_names([dae.expression(name)])]
        while pending:
            name = pending.pop()
            if name in self.used:
                continue
            self.used.add(name)
            if name in givers and givers[name] not in taken:
                taken.add(givers[name])
                pending += givers[name].leaves
            for one in instants:
                if one not in taken and self._sets(one, name):
                    taken.add(one)
                    asked.update(dict.fromkeys(one.names))
                    pending += [leaf for n in one.names for leaf in symbol_names([dae.expression(n)])]
        self.sections = [s for s in every if s in taken]
        self.instants = tuple(one for one in instants if one in taken)
        self.asked = tuple(asked)
        self.answers = tuple(self._answers())

    def _sets(self, one: AtInstants, name: str) -> bool:
        return any(name in symbol_names([self.dae.expression(n)]) for n in one.sets)

    def _answers(self) -> Iterable[tuple[str, ca.SX]]:
        dae = self.dae
        given = {n for name in dae.request.given for n in dae.expand(name)}
        for name in self.asked:
            expression = dae.expression(name)
            if name in dae.adjustable and name in self.wanted and name not in given:
                yield name, ca.SX(dae.parameter_values[name])
            elif not (expression.is_symbolic() and expression.name() == name):
                yield name, expression

    def equations(self) -> tuple[Equation, ...]:
        """The equations as written from which the answers follow, in their order."""
        dae = self.dae
        kept = {id(dae.reduced.equations[index]) for s in self.sections for index, _ in s.keys}
        left = {id(e) for e in (*dae.redundant, *dae.reduced.redundant, *dae.reduced.equations)} - kept
        names = {id(e): self._variables((e.left, e.right)) for e in dae.flat.equations if id(e) not in left}
        equal = {key for key in names if key not in kept and self._known_by_root(names[key])}
        ends = [self._variables([e]) for one in self.instants for e in one.expressions]
        ends += [
            set(map(_base, self.asked)),
            set(dae.known),
            {_base(n) for n in dae.choice.states if n in self.used},
        ]
        counts = Counter(n for key in (*kept, *equal) for n in names[key])
        counts.update(n for end in ends for n in end)
        loose = True
        while loose:  # what says that names are equal of which one stands nowhere else
            loose = {key for key in equal if any(counts[n] == 1 for n in names[key])}
            equal -= loose
            counts.subtract(n for key in loose for n in names[key])
        reached = set().union(*(names[key] for key in kept), *ends) if kept or ends else set[str]()
        near = True
        while near:  # from what is kept, equation by equation
            near = {key for key in equal if names[key] & reached}
            equal, kept = equal - near, kept | near
            reached = reached.union(*(names[key] for key in near))
        return tuple(e for e in dae.flat.equations if id(e) in kept)

    def _variables(self, expressions: Iterable[ca.SX]) -> set[str]:
        """Variables in expressions of the model, through what is propagated."""
        found: set[str] = set()
        pending = list(symbol_names(expressions))
        while pending:
            name = _base(pending.pop())
            if name in self.dae.flat.definitions and name not in found:
                pending += symbol_names([self.dae.flat.definitions[name]])
            if name in self.dae.flat.definitions or name in self.dae.reduced.aliases:
                found.add(name)
        return found - self.dae.flat.definitions.keys()

    def _known_by_root(self, names: Collection[str]) -> bool:
        """Whether variables are multiples of what is used."""
        roots = {_base(n) for n in self.used}
        aliases: Mapping = self.dae.reduced.aliases
        return bool(names) and all(aliases[n].root is None or aliases[n].root in roots for n in names)


def _base(name: str) -> str:
    return split_derivative(without_pre(name)).root
