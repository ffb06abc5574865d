"""The equations of a Dae as one HTML page, complete in itself: by component, by block, and tables of all names."""

from collections.abc import Iterable
from html import escape

import casadi as ca

from gantrytau.compiler.translated import Translated
from gantrytau.describing.pages import folded, page, table
from gantrytau.flattening.flat_model import FlatParameter, FlatVariable
from gantrytau.language.statements import Equation
from gantrytau.language.symbols import split_derivative
from gantrytau.writing.mathml import MathSyntax, equality, html_name
from gantrytau.writing.sections import Section, sections
from gantrytau.writing.subexpressions import written_at
from gantrytau.writing.text import PlainSyntax, event_lines, plain_number

STYLE = """
body { max-width: 76rem; }
nav a { margin-right: 1.2rem; }
details { border-left: 3px solid #8886; padding-left: 1rem; margin: .4rem 0; }
.equation { overflow-x: auto; padding: .3rem 0; }
.origin { color: #888; font-size: .8rem; }
math a { color: inherit; text-decoration: none; }
math a:hover { text-decoration: underline; }
math { text-align: left; font-size: 1.05rem; }
table { width: 100%; }
td:first-child { white-space: nowrap; }
:target { outline: 2px solid orange; }
"""
HEAD = ("name", "unit", "description", "role", "start or value")
Declared = FlatVariable | FlatParameter


def html_page(dae: Translated, summary: str) -> str:
    """The page, which opens with a summary of the model. Raises ModelError for an expression that cannot be read."""
    return _Page(dae).text(summary)


class _Page:
    def __init__(self, dae: Translated):
        self.dae, self.flat = dae, dae.flat
        self.declared: dict[str, tuple[Declared, int]] = {
            n: (v, k)
            for v in (*dae.flat.variables, *dae.flat.parameters, *dae.flat.propagated)
            for k, n in enumerate(v.elements)
        }
        self.anchors = {name: f"v{number}" for number, name in enumerate(self.declared)}
        leaves = [s.name() for s in ca.symvar(ca.SX(ca.vertcat(*(e.residual for e in self.flat.equations))))]
        inner = [s.name() for s in ca.symvar(ca.SX(ca.vertcat(*dae.indexed.residuals.values())))]
        for name in (*leaves, *inner):  # a derivative leads to its variable
            base = split_derivative(name)[0]
            if base in self.anchors:
                self.anchors.setdefault(name, self.anchors[base])
        self.titles = {name: self._title(name) for name in self.anchors}
        self.syntax = MathSyntax(self.titles, self.anchors)

    def _title(self, name: str) -> str:
        base, order = split_derivative(name)
        variable, _ = self.declared[base]
        unit = f" [{variable.unit}]" if variable.unit and order == 0 else ""
        prefix = "derivative of " * order
        return f"{name}{unit}: {prefix}{variable.description or variable.kind}"

    def text(self, summary: str) -> str:
        title = f"Equations of {self.dae.name}"
        parts = [
            f"<h1>{escape(title)}</h1>",
            '<nav><a href="#components">by component</a><a href="#blocks">by block</a>'
            '<a href="#tables">variables and parameters</a></nav>',
            f"<pre>{escape(summary)}</pre>",
            '<h2 id="components">By component, as written</h2>',
            *self._components(),
            *self._events(),
            '<h2 id="blocks">By block, in the order of solution</h2>',
            *(self._block(section) for section in sections(self.dae)),
            '<h2 id="tables">Variables and parameters</h2>',
            *self._tables(),
        ]
        return page(title, parts, STYLE)

    def _components(self) -> list[str]:
        groups: dict[str, list[Equation]] = {}
        for equation in self.flat.equations:
            if equation.model == "connection":
                heading = "connections"
            else:
                heading = f"{equation.path or 'the model'} ({equation.model})"
            groups.setdefault(heading, []).append(equation)
        if self.flat.initial_equations:
            groups["initial equations"] = list(self.flat.initial_equations)
        return [self._component(heading, found) for heading, found in groups.items()]

    def _events(self) -> list[str]:
        lines = [f"<pre>{escape(line)}</pre>" for line in event_lines(self.dae)]
        return [folded("<b>set at instants</b>", lines, opened=True)] if lines else []

    def _component(self, heading: str, equations: list[Equation]) -> str:
        sides = [side for e in equations for side in (e.left, e.right)]
        text = written_at(heading, sides, self.syntax)
        redundant = {id(e) for e in (*self.dae.redundant, *self.dae.reduced.redundant)}
        lines = [_row(equality(name, value)) for name, value in text.definitions]
        for number, equation in enumerate(equations):
            left, right = text.expressions[2 * number : 2 * number + 2]
            note = " (follows from the others)" if id(equation) in redundant else ""
            lines.append(_row(equality(left.text, right.text), equation.name + note))
        count = len(equations)
        summary = f"<b>{escape(heading)}</b>: {count} equation{'' if count == 1 else 's'}"
        return folded(summary, [*lines, self._glossary(sides)])

    def _block(self, section: Section) -> str:
        text = written_at(section.origin, (line.right for line in section.lines), self.syntax)
        lines = [_row(equality(name, value)) for name, value in text.definitions]
        for line, value in zip(section.lines, text.expressions, strict=True):
            left = "<mn>0</mn>" if line.left is None else self.syntax.symbol(line.left).text
            lines.append(
                _row(equality(left, value.text), f"determines {line.determines}" if line.determines else "")
            )
        origin = f'<div class="origin">from {escape(section.origin)}</div>'
        unknowns = [html_name(n) for n in section.unknowns[:4]]
        more = f" and {len(section.unknowns) - 4} more" if len(section.unknowns) > 4 else ""
        summary = f"[{section.number}] {', '.join(unknowns)}{more} ({escape(section.title)})"
        used = [line.right for line in section.lines]
        return folded(
            summary, [*lines, origin, self._glossary(used, section.unknowns)], opened=section.single
        )

    def _glossary(self, expressions: Iterable[ca.SX], more: Iterable[str] = ()) -> str:
        """What the names in some expressions mean."""
        used = dict.fromkeys([*more, *(s.name() for s in ca.symvar(ca.SX(ca.vertcat(*expressions))))])
        bases = dict.fromkeys(split_derivative(n)[0] for n in used)
        rows = [self._cells(name)[:3] for name in bases if name in self.declared]
        return folded("names", [table(HEAD[:3], rows)]) if rows else ""

    def _tables(self) -> list[str]:
        states = list(dict.fromkeys(split_derivative(n)[0] for n in self.dae.states))
        variables = [n for v in self.flat.variables for n in v.elements]
        parameters = [n for p in self.flat.parameters for n in p.elements]
        groups = [("states", states), ("inputs", list(self.dae.known)), ("outputs", list(self.dae.outputs))]
        found = [
            folded(f"{word}: {len(names)}", [self._table(names)], opened=True)
            for word, names in groups
            if names
        ]
        found.append(folded(f"parameters: {len(parameters)}", [self._table(parameters, anchored=True)]))
        found.append(folded(f"variables: {len(variables)}", [self._table(variables, anchored=True)]))
        if self.flat.definitions:
            found.append(
                folded(f"propagated quantities: {len(self.flat.definitions)}", [self._definitions()])
            )
        return found

    def _table(self, names: Iterable[str], anchored: bool = False) -> str:
        names = list(names)
        marks = [f'id="{self.anchors[name]}"' for name in names] if anchored else None
        return table(HEAD, map(self._cells, names), marks=marks)

    def _cells(self, name: str) -> tuple[str, ...]:
        variable, _ = self.declared[name]
        return (name, variable.unit or "", variable.description, self._role(name), self._value(name))

    def _role(self, name: str) -> str:
        variable, _ = self.declared[name]
        if variable.kind == "propagated":
            return "passed on"
        if isinstance(variable, FlatParameter):
            return "parameter" if name in self.dae.table.independent else "parameter, follows from others"
        if name in self.dae.known:
            return "known"
        if name in self.dae.states:
            return "state"
        alias = self.dae.reduced.aliases[name]
        if alias.root == name and alias.order == 0:
            return variable.kind
        return f"{variable.kind}, equal to {_plain(self.dae.expression(name))}"

    def _value(self, name: str) -> str:
        variable, k = self.declared[name]
        if isinstance(variable, FlatParameter):
            number = plain_number(self.dae.table.values[name])
            binding = variable.value[k]
            return number if binding.is_constant() else f"{number} = {_plain(binding)}"
        if variable.start is None:
            return ""
        return _plain(variable.start[k]) + (", fixed" if variable.fixed else "")

    def _definitions(self) -> str:
        text = written_at("propagated quantities", self.flat.definitions.values(), self.syntax)
        lines = [_row(equality(name, value)) for name, value in text.definitions]
        for name, value in zip(self.flat.definitions, text.expressions, strict=True):
            math = equality(f"<mtext>{html_name(name)}</mtext>", value.text)
            lines.append(f'<div class="equation" id="{self.anchors[name]}">{math}</div>')
        return "\n".join(lines)


def _plain(expression: ca.SX) -> str:
    text = written_at("a value", [expression], PlainSyntax())
    where = [f"{name} = {value}" for name, value in text.definitions]
    return text.expressions[0].text + (f" with {', '.join(where)}" if where else "")


def _row(math: str, origin: str = "") -> str:
    words = f'<div class="origin">{escape(origin)}</div>' if origin else ""
    return f'<div class="equation">{math}{words}</div>'
