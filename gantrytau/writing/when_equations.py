"""What a flat model states of instants in Modelica: whens, samplings and delays (Language Specification 3.6, section 8.3.5).

What is sampled is a `when sample(...)`, with `pre(x)` for values just before. A when of Modelica does not act at the start;
one that does has the variable '=begun' in its condition, which becomes 1 right after the start.
"""

import re
from collections.abc import Collection, Iterator

import casadi as ca

from gantrytau.flattening.flat_model import FlatModel, Sampled, When
from gantrytau.language.statements import place_of
from gantrytau.writing.graph import Graph, Node
from gantrytau.writing.modelica_syntax import ModelicaSyntax, quoted, string
from gantrytau.writing.subexpressions import located, worth_a_name
from gantrytau.writing.syntax import AND, Written, write

BEGUN = quoted("=begun")
ONCE = 1e9  # s, a period that no simulation reaches the end of
NEXT_SAMPLE = re.compile(r"(.*\.)?next_sample_\d+")  # holds the next instant of a `sample` in Modelica text


class WhenEquations:
    """Whens of a flat model.

    spoken: names that are calls there, of delays and of instants of samples; aside: expressions of samplings that are too
    large to be written in place, by the names of variables that equal them; declared: variables that they need.
    """

    def __init__(self, flat: FlatModel, graph: Graph, saving: int):
        self.flat, self.graph = flat, graph
        self.spoken: dict[str, Written] = {}
        self.syntax = ModelicaSyntax(self.spoken)
        self._samples: dict[Node, Written] = {}
        for one in flat.delays:
            self.spoken[one.name] = Written(f"delay({self._text(one.expression)}, {self._text(one.time)})")
        for one in flat.whens:
            if len(one.assignments) == 1 and NEXT_SAMPLE.fullmatch(one.assignments[0][0]) and one.after >= 0:
                self._read_sample(flat.whens[one.after], one)
        self.held = {*(one.name for one in flat.sampled), *flat.discretes} - self.spoken.keys()
        self.aside: dict[str, Node] = {}
        for one in flat.sampled:
            (node,) = graph.read([one.expression])
            if worth_a_name([node], saving=saving):
                self.aside[f"={one.name}"] = node
        variables = {n for v in (*flat.variables, *flat.propagated) for n in v.elements}
        self._moving = variables - self.spoken.keys()
        others = (one for one in flat.whens if not any(name in self.spoken for name, _ in one.assignments))
        starting = any(one.initially and one.words != "sample" for one in others)
        self.declared = [f"  discrete Real {BEGUN}(start=0, fixed=true);"] if starting else []

    def _text(self, expression: ca.SX) -> str:
        (node,) = self.graph.read([expression])
        return write([node], self.syntax, {})[node].text

    def _read_sample(self, first: When, one: When) -> None:
        """The condition `time >= next` of a `sample`, next = pre(next) + n * period; first: next = start + n * period."""
        ((name, value),) = one.assignments
        symbols = [self.flat.time, *(s for s in ca.symvar(value) if s.name() == f"pre({name})")]
        period = ca.substitute(value, ca.vertcat(*symbols), ca.DM.zeros(len(symbols)))
        ((_, begun),) = first.assignments
        sides = [begun.dep(k) for k in range(2)] if begun.is_op(ca.OP_ADD) else []
        start = next((side for side in sides if not ca.depends_on(side, self.flat.time)), ca.SX(0))
        self.spoken[name] = Written(f"sample({self._text(start)}, {self._text(period)})")
        self._samples[self._truth(one.condition)] = self.spoken[name]

    def _truth(self, condition: ca.SX) -> Node:
        return self.graph.truth(*self.graph.read([condition]))

    def _before(self, expression: ca.SX, names: Collection[str]) -> ca.SX:
        """An expression with the values of some variables just before the instant."""
        leaves = [s for s in ca.symvar(expression) if s.name() in names]
        before = [ca.SX.sym(f"pre({s.name()})") for s in leaves]
        return ca.substitute(expression, ca.vertcat(*leaves), ca.vertcat(*before)) if leaves else expression

    def lines(self) -> Iterator[str]:
        """The whens, line by line."""
        if self.declared:
            yield from (f"  when sample(0, {ONCE:g}) then", f"    {BEGUN} = 1;", "  end when;")
        periods: dict[str, list[Sampled]] = {}
        for one in self.flat.sampled:
            with located(one.label):
                periods.setdefault(self._text(one.period), []).append(one)
        for period, together in periods.items():
            yield f"  when sample(0, {period}) then"
            for one in together:
                yield f"    {quoted(one.name)} = {self._sampled(one)} {string(one.label)};"
            yield "  end when;"
        word = "when"
        for number, one in enumerate(self.flat.whens):
            if any(name in self.spoken for name, _ in one.assignments):
                continue
            with located(one.label):
                yield f"  {word} {self._condition(one)} then"
                yield from (f"    {action};" for action in self._actions(one))
                others = self._chain(number) - {name for name, _ in one.assignments}
                yield from (f"    {quoted(name)} = pre({quoted(name)});" for name in sorted(others))
            last = not any(later.after == number for later in self.flat.whens)
            word = "when" if last else "elsewhen"
            if last:
                yield f"  end when {string(place_of(one.path, one.model, one.number))};"

    def _chain(self, number: int) -> set[str]:
        """Names that the branches of the chain of a when set, all of which each branch has to set in Modelica."""
        whens = self.flat.whens
        while whens[number].after >= 0:
            number = whens[number].after
        found = {name for name, _ in whens[number].assignments}
        while (number := next((k for k, one in enumerate(whens) if one.after == number), -1)) >= 0:
            found |= {name for name, _ in whens[number].assignments}
        return found

    def _sampled(self, one: Sampled) -> str:
        if f"={one.name}" in self.aside:
            return f"pre({quoted(f'={one.name}')})"
        with located(one.label):
            return self._text(self._before(one.expression, self._moving))

    def _condition(self, one: When) -> str:
        node = self._truth(one.condition)
        found = self._samples.get(node) or write([node], self.syntax, self._samples)[node]
        if not one.initially or one.words == "sample":
            return found.text
        return f"{self.syntax.enclose(found.text) if found.level < AND else found.text} and {BEGUN} > 0.5"

    def _actions(self, one: When) -> Iterator[str]:
        moving = self._moving - self.held
        for name, value in one.reinits:
            yield f"reinit({quoted(name)}, {self._text(self._before(value, moving))})"
        for name, value in one.assignments:
            yield f"{quoted(name)} = {self._text(self._before(value, moving))}"
        if one.failure:
            yield f"assert(false, {string(one.failure)})"
        if one.message:
            yield f"terminate({string(one.message)})"
