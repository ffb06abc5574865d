"""The equations of a Dae as one HTML page, complete in itself: by component, by block, and a table of all quantities.

Equations as written have numbers (1), blocks [1], and both lead to each other; names lead to the table, and the table back.
"""

from collections.abc import Iterable, Sequence
from html import escape

import casadi as ca

from gantrytau.compiler.translated import Translated
from gantrytau.describing.pages import folded, page
from gantrytau.language.statements import Equation
from gantrytau.language.symbols import split_derivative
from gantrytau.writing.equations_page.quantity_table import Quantities, links
from gantrytau.writing.equations_page.whole_vectors import WholeGraph
from gantrytau.writing.equations_page.wrapping_formulas import NO_BREAK, FormulaSyntax
from gantrytau.writing.excerpt import excerpt
from gantrytau.writing.graph import Node
from gantrytau.writing.instants_written import AtInstants, line_written
from gantrytau.writing.sections import Section, origins_of, section_text
from gantrytau.writing.subexpressions import Text, located, written, written_at
from gantrytau.writing.syntax import ordered

LONG = 60  # lines from which on a part is folded
STYLE = """
body { max-width: 64rem; }
a { color: inherit; }
nav a { margin-right: 1.2rem; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .2rem 1rem; }
dd { margin: 0; }
pre { white-space: pre-wrap; }
details { border-left: 3px solid #8884; padding-left: 1rem; margin: .5rem 0; }
p { margin: .3rem 0; padding-left: 5.4rem; text-indent: -2rem; overflow-wrap: anywhere; }
p[id] { text-indent: -5.4rem; }
p > span { display: inline-block; width: 3.4rem; text-indent: 0; opacity: .75; }
p::after { content: ""; display: block; clear: both; }
small { float: right; max-width: 24rem; margin-left: 1rem; text-indent: 0; text-align: right; line-height: 1.5; }
small, .from, td:nth-child(6) { font: .78rem/1.5 system-ui, sans-serif; opacity: .75; }
:is(small, .from) a { font-style: normal; }
.from { padding: 0; text-indent: 0; }
p, dd,  td:nth-child(4), td:nth-child(5) {
  font-family: "STIX Two Text", Cambria, "Libertinus Serif", Georgia, "DejaVu Serif", serif; }
p { font-size: 1.05rem; line-height: 1.7; }
p a, dd a, td:nth-child(4) a, td:nth-child(5) a, i { font-style: italic; }
p a, dd a, td a { text-decoration: none; }
p a:hover, dd a:hover, td a:hover, .from a, small a { text-decoration: underline; }
sub, sup { font-size: .7em; line-height: 0; font-style: normal; }
b { font-weight: normal; font-style: normal; }
summary b { font-weight: 600; }
math, mtext { font-family: inherit; text-indent: 0; }
mtext span { white-space: nowrap; overflow-wrap: normal; }
math { math-style: normal; }
mfrac { padding: 0 .15em; }
table { width: 100%; }
tr { border-bottom: 1px solid #8886; }
th, td { border: 0; }
td:is(:first-child, :nth-child(4), :nth-child(5)) { overflow-wrap: anywhere; min-width: 6rem; }
td:first-child { min-width: 13rem; font-size: .8rem; }
td:nth-child(2) { white-space: nowrap; }
td:nth-child(3) { min-width: 12rem; }
td:nth-child(6) { max-width: 9rem; }
:target { outline: 2px solid orange; }
@media (max-width: 700px) { p { overflow-x: auto; } table { display: block; overflow-x: auto; } }
@media print { body { max-width: none; } p, tr { break-inside: avoid; } }
"""
# what a name means, on the name; parts that are folded open for links and for print
SCRIPT = """<script>
document.onmouseover = e => { const a = e.target.closest('a[href^="#v"]'), row = a && document.querySelector(a.hash);
  if (row && !a.title) { const c = [...row.cells].map(x => x.textContent); a.title = `${c[0]} [${c[1]}]: ${c[2]}`; } };
const open = () => { const found = location.hash && document.querySelector(location.hash);
  for (let d = found; d; d = d.parentElement) if (d.tagName == 'DETAILS') d.open = true;
  if (found) found.scrollIntoView({ block: 'center' }); };
onhashchange = open; open();
onbeforeprint = () => document.querySelectorAll('details').forEach(d => { d.open = true; });
</script>"""


def html_page(dae: Translated, summary: str) -> str:
    """The page; summary: what the diagnosis says, "" for nothing. ModelError for an expression that cannot be read."""
    return _Page(dae).text(summary)


class _Page:
    def __init__(self, dae: Translated):
        self.dae, self.flat, self.excerpt = dae, dae.flat, excerpt(dae)
        self.quantities = Quantities(dae)
        self.syntax = FormulaSyntax(self.quantities.anchors)
        self.groups = self._grouped()
        self.numbers = self._numbered()  # of equations as written, by row
        self.blocks_of: dict[int, list[int]] = {}  # equation -> blocks
        self.standing: dict[str, dict[tuple[str, int], None]] = {}  # quantity -> equations and blocks
        for section in self.excerpt.sections:
            for index, _ in section.keys:
                blocks = self.blocks_of.setdefault(self.numbers[id(dae.reduced.equations[index])], [])
                blocks += [] if section.number in blocks else [section.number]

    def text(self, summary: str) -> str:
        found = self.excerpt
        title = f"Equations of {self.dae.name}"
        solved = ['<h2 id="blocks">In the order of solution</h2>', *self._events()]
        solved += [*map(self._block, found.sections), *self._answers()]
        components = ['<h2 id="components">By component, as written</h2>', *self._components()]
        parts = [
            f"<h1>{escape(title)}</h1>",
            '<nav><a href="#components">by component</a><a href="#blocks">in the order of solution</a>'
            '<a href="#tables">quantities</a></nav>',
            self._glance(),
            folded("diagnosis", [f"<pre>{escape(summary)}</pre>"]) if summary else "",
            *([*solved, *components] if found.wanted else [*components, *solved]),
            '<h2 id="tables">Quantities</h2>',
            *self._tables(),
            SCRIPT,
        ]
        return page(title, parts, STYLE)

    def _glance(self) -> str:
        """What is known, wanted, and a state."""
        found = self.excerpt
        states = [
            self._name(name) + ("" if name == symbol else f" = {self._name(symbol)}")
            for name, symbol in found.states
        ]
        remarks = {name: found.remark(scalars) for name, scalars in found.asked}
        wanted = [self._name(n) + (f" ({remark})" if remark else "") for n, remark in remarks.items()]
        rows = [("wanted", ", ".join(wanted))] if wanted else []
        rows += [("known", ", ".join(map(self._name, found.known)) or "nothing")]
        count = f"{len(states)} state{'' if len(states) == 1 else 's'}" if states else "states"
        rows += [(count, ", ".join(states) or "none")]
        rows += [("blocks", found.left_out)] if found.left_out else []
        return "<dl>" + "".join(f"<dt>{word}</dt><dd>{text}</dd>" for word, text in rows) + "</dl>"

    def _name(self, name: str) -> str:
        return self.syntax.symbol(name).text

    # equations as written

    def _grouped(self) -> dict[str, list[list[Equation]]]:
        """Equations by component, rows of one vector equation together."""
        groups: dict[str, dict[tuple[str, int, bool], list[Equation]]] = {}
        seen: dict[str, int] = {}
        equations = [(_heading(e), e) for e in self.excerpt.equations]
        if not self.excerpt.wanted:
            equations += [("initial equations", e) for e in self.flat.initial_equations]
        for heading, equation in equations:
            often = seen[equation.name] = seen.get(equation.name, -1) + 1
            name = equation.name.partition(", row ")[0]
            key = (name, often, equation.element is None)
            groups.setdefault(heading, {}).setdefault(key, []).append(equation)
        return {heading: list(rows.values()) for heading, rows in groups.items()}

    def _numbered(self) -> dict[int, int]:
        """The number of the first line of the equation that each row belongs to."""
        every = [rows for found in self.groups.values() for rows in found]
        return {id(e): number for number, rows in enumerate(every, start=1) for e in rows}

    def _components(self) -> list[str]:
        self.homes = {h.partition(" (")[0]: f"c{k}" for k, h in enumerate(self.groups)}
        return [self._component(k, heading, rows) for k, (heading, rows) in enumerate(self.groups.items())]

    def _component(self, place: int, heading: str, groups: Sequence[Sequence[Equation]]) -> str:
        path = groups[0][0].path if " (" in heading else ""
        syntax = FormulaSyntax(self.quantities.anchors, path)
        redundant = {id(e) for e in (*self.dae.redundant, *self.dae.reduced.redundant)}
        graph = WholeGraph(self.quantities.elements)
        with located(heading):
            lines = [line for rows in groups for line in _lines(graph, rows)]
            text = written([side for _, sides in lines for side in sides], syntax)
        parts = [_row(f"{name} = {value}") for name, value in text.definitions]
        counted = set[int]()
        for k, (equation, sides) in enumerate(lines):
            number = self.numbers[id(equation)]
            left, right = text.expressions[2 * k : 2 * k + 2]
            self._stands(sides, ("e", number))
            first, note = number not in counted, []
            counted.add(number)
            if first:
                note += [escape(equation.label.partition(", row ")[0])]
                note += ["follows from the others"] if id(equation) in redundant else []
                note += [links("b", self.blocks_of.get(number, ()), "[]")]
            mark, label = (f"e{number}", f"({number})") if first else ("", "")
            parts.append(_row(f"{left.text} = {right.text}", ", ".join(filter(None, note)), mark, label))
        count = len(groups)
        summary = f"<b id=c{place}>{escape(heading)}</b>: {count} equation{'' if count == 1 else 's'}"
        return folded(summary, parts, opened=len(parts) <= LONG)

    def _needed_definitions(self) -> list[str]:
        """Propagated scalars that the equations of the excerpt need."""
        pending = [s.name() for e in self.excerpt.equations for x in (e.left, e.right) for s in ca.symvar(x)]
        pending += self.excerpt.wanted
        found: set[str] = set()
        while pending:
            name = split_derivative(pending.pop()).root
            if name in self.flat.definitions and name not in found:
                found.add(name)
                pending += [s.name() for s in ca.symvar(self.flat.definitions[name])]
        return [n for n in self.flat.definitions if n in found]

    # blocks

    def _events(self) -> list[str]:
        return [line for one in self.excerpt.instants for line in self._event(one)]

    def _event(self, one: AtInstants) -> list[str]:
        shared, words, note = line_written(one, self.syntax, lambda text: escape(text, quote=False))
        return [_row(words, note), *(_row(f"{name} = {value}") for name, value in shared)]

    def _block(self, section: Section) -> str:
        text = section_text(section, self.syntax)
        for line in section.lines:
            names = [s.name() for s in ca.symvar(line.right)]
            for name in (*names, *filter(None, [line.left])):
                self._place(name, ("b", section.number))
        mark, label = f"b{section.number}", f"[{section.number}]"
        if section.single:
            kind = "" if section.kind == "explicit" else f"{section.kind}, "
            lines = self._solved(section, text)
            return "\n".join(
                [_row(lines[0], f"{kind}from {self._origins(section)}", mark, label), *self._shared(text)]
            )
        names = ", ".join(section.unknowns[:6])
        more = f" and {len(section.unknowns) - 6} more" if len(section.unknowns) > 6 else ""
        summary = f"<b id={mark}>{label} {escape(names, quote=False)}{more}</b> ({escape(section.title)})"
        rows = [
            *self._shared(text),
            *map(_row, self._solved(section, text), map(self._determines, section.lines)),
        ]
        origin = f'<p class="from">from {self._origins(section)}'
        return folded(summary, [origin, *rows], opened=len(rows) <= LONG)

    def _determines(self, line) -> str:
        return f"determines <i>{self._name(line.determines)}</i>" if line.determines else ""

    def _solved(self, section: Section, text: Text) -> list[str]:
        left = ["0" if line.left is None else self._name(line.left) for line in section.lines]
        return [f"{name} = {value.text}" for name, value in zip(left, text.expressions, strict=True)]

    def _shared(self, text: Text) -> list[str]:
        return [_row(f"{name} = {value}") for name, value in text.definitions]

    def _origins(self, section: Section) -> str:
        found = []
        for _, words, equation in origins_of(self.dae, section.keys):
            number = self.numbers[id(equation)]
            place = "connection" if equation.model == "connection" else equation.path or "the model"
            often = words[words.find(", differentiated") + 1 :] if ", differentiated" in words else ""
            found.append(f"<a href=#e{number}>{escape(place)}{NO_BREAK}({number})</a>{often}")
        return "; ".join(found)

    def _answers(self) -> list[str]:
        """What the wanted names are that no block gives."""
        found = self.excerpt.answers
        if not found:
            return []
        text = written_at(", ".join(n for n, _ in found), [e for _, e in found], self.syntax)
        lines = [f"{self._name(n)} = {e.text}" for (n, _), e in zip(found, text.expressions, strict=True)]
        return ['<p class="from">so that', *self._shared(text), *map(_row, lines)]

    # quantities

    def _tables(self) -> list[str]:
        only = None
        if self.excerpt.wanted:
            shown = (*self.standing, *self.excerpt.known, *self.excerpt.wanted, *self._needed_definitions())
            shown += tuple(n for n, _ in self.excerpt.answers) + tuple(
                n for one in self.excerpt.instants for n in one.names
            )
            shown += tuple(s.name() for _, e in self.excerpt.answers for s in ca.symvar(e))
            only = {self.quantities.elements.get(split_derivative(n).root, (n,))[0] for n in shown}
        return self.quantities.tables(only, self._places, lambda owner: self.homes.get(owner, ""))

    def _places(self, name: str) -> str:
        found = self.standing.get(name, {})
        equations = [n for kind, n in found if kind == "e"]
        blocks = [n for kind, n in found if kind == "b"]
        return " ".join(filter(None, [links("e", equations, "()"), links("b", blocks, "[]")]))

    def _stands(self, nodes: Iterable[Node], place: tuple[str, int]) -> None:
        for node in ordered(nodes):
            if node.operation == "symbol":
                self._place(str(node.value), place)

    def _place(self, name: str, place: tuple[str, int]) -> None:
        base = split_derivative(name).root
        whole = self.quantities.elements.get(base, (base,))[0]
        self.standing.setdefault(whole, {})[place] = None


def _heading(equation: Equation) -> str:
    """Of the component that an equation stands in."""
    return (
        "connections"
        if equation.model == "connection"
        else f"{equation.path or 'the model'} ({equation.model})"
    )


def _lines(graph: WholeGraph, rows: Sequence[Equation]) -> list[tuple[Equation, list[Node]]]:
    """The two sides of an equation, of whole vectors where its rows say the same of their elements."""
    if len(rows) > 1 and [e.element for e in rows] == list(range(len(rows))):
        whole = graph.rows([(e.left, e.right) for e in rows])
        if whole is not None:
            return [(rows[0], whole)]
    return [(e, graph.read((e.left, e.right))) for e in rows]


def _row(formula: str, note: str = "", mark: str = "", label: str = "") -> str:
    """A formula as a paragraph, whose end tag goes without saying in HTML."""
    words = f"<small>{note}</small>" if note else ""
    number = f"<span>{label}</span>" if label else ""
    return f"<p{f' id={mark}' if mark else ''}>{number}{formula}{words}"
