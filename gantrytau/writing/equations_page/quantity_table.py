"""The table of quantities: one row each, vectors whole, to which the names in formulas lead."""

from collections.abc import Callable, Collection, Iterable, Sequence
from html import escape

import casadi as ca

from gantrytau.compiler.translated import Translated
from gantrytau.describing.pages import folded
from gantrytau.flattening.flat_model import FlatParameter, FlatVariable
from gantrytau.language.symbols import split_derivative
from gantrytau.writing.equations_page.whole_vectors import WholeGraph
from gantrytau.writing.equations_page.wrapping_formulas import FormulaSyntax
from gantrytau.writing.subexpressions import located, written

HEAD = ("name", "unit", "description", "role", "start or value", "in")
NARROW = 12  # letters in a cell that are not broken
Declared = FlatVariable | FlatParameter


class Quantities:
    """All declared quantities of a model, with their places on the page."""

    def __init__(self, dae: Translated):
        self.dae, self.flat = dae, dae.flat
        self.all: tuple[Declared, ...] = (*dae.flat.parameters, *dae.flat.variables, *dae.flat.propagated)
        self.anchors = {n: f"v{k}" for k, v in enumerate(self.all) for n in (v.name, *v.elements)}
        self.elements = {n: (v.name, k, len(v.elements)) for v in self.all for k, n in enumerate(v.elements)}
        self.syntax = FormulaSyntax(self.anchors, widest=NARROW)

    def tables(
        self, only: Collection[str] | None, places: Callable[[str], str], owners: Callable[[str], str]
    ) -> list[str]:
        """Tables, folded where they are long. only: names of quantities, None: all of them.

        places: links to where a quantity stands; owners: the anchor of a component, "" for none.
        """
        groups: dict[str, list[Declared]] = {"states": [], "known": [], "outputs": []}
        groups |= {"parameters": [], "variables": [], "passed on from frame to frame": []}
        for one in self.all:
            if only is None or one.name in only:
                groups[self._group(one)].append(one)
        found = []
        for word, members in groups.items():
            if members:
                rows = [self._row(one, places(one.name), owners(one.owner)) for one in members]
                top = "".join(f"<th>{cell}" for cell in HEAD)
                text = "\n".join(["<table>", f"<tr>{top}", *rows, "</table>"])
                few = len(members) <= 40
                found.append(folded(f"<b>{word}</b>: {self._count(word, members)}", [text], opened=few))
        return found

    def _count(self, word: str, members: Sequence[Declared]) -> str:
        if word == "states":
            own = {n for one in members for n in one.elements}
            return str(sum(split_derivative(n).root in own for n in self.dae.states))
        scalars = sum(len(one.elements) for one in members)
        return str(len(members)) if scalars == len(members) else f"{len(members)}, {scalars} scalars"

    def _group(self, one: Declared) -> str:
        if isinstance(one, FlatParameter):
            return "parameters"
        if one.kind == "propagated":
            return "passed on from frame to frame"
        names = {split_derivative(n).root for n in self.dae.states}
        if names & set(one.elements):
            return "states"
        if set(self.dae.known) & set(one.elements):
            return "known"
        return "outputs" if one.kind == "output" else "variables"

    def _row(self, one: Declared, places: str, owner: str) -> str:
        name = escape(one.name, quote=False)
        if owner and one.owner and one.name.startswith(one.owner):
            rest = escape(one.name.removeprefix(one.owner), quote=False)
            name = f"<a href=#{owner}>{escape(one.owner, quote=False)}</a>{rest}"
        text = escape(one.description, quote=False)
        cells = [name, escape(one.unit or ""), text, self._roles(one), self._values(one), places]
        while not cells[-1]:
            cells.pop()
        return f"<tr id={self.anchors[one.name]}><td>{'<td>'.join(cells)}"

    def _roles(self, one: Declared) -> str:
        """What its elements are for the equations, once for all where that is the same."""
        if one.kind == "propagated":
            return ""
        if isinstance(one, FlatParameter):
            told = not all(v.is_constant() for v in one.value)  # by its formula
            own = set(one.elements) <= set(self.dae.table.independent)
            return "" if own or told else "shapes the equations"
        groups: dict[str, list[str]] = {}
        for name in one.elements:
            groups.setdefault(self._role(one, name), []).append(escape(name[len(one.name) :], quote=False))
        words = "; ".join(r if len(groups) == 1 else f"{', '.join(i)}: {r}" for r, i in groups.items() if r)
        return ", ".join(filter(None, [words, self._equal(one)]))

    def _role(self, one: Declared, name: str) -> str:
        states = [n for n in self.dae.states if split_derivative(n).root == name]
        words = ["state" if name in states else "its derivative is a state"] if states else []
        words = ["state, with its derivative"] if len(states) > 1 else words
        words += ["known"] if name in self.dae.known else []
        return ", ".join([*words, *([one.kind] if one.kind not in ("real", "input") else [])])

    def _equal(self, one: Declared) -> str:
        """What it is equal to, if it was removed as an alias: a formula if that is short, else what it follows from."""
        aliases = [self.dae.reduced.aliases[n] for n in one.elements]
        if all(alias.root == n and alias.order == 0 for alias, n in zip(aliases, one.elements, strict=True)):
            return ""
        values = [self.dae.expression(n) for n in one.elements]
        same = WholeGraph(self.elements).rows([[v] for v in values]) if len(values) > 1 else None
        if same or len(values) == 1 or all(v.is_constant() for v in values):
            return f"= {self._formulas(one, values)}"
        roots = dict.fromkeys(
            a.root for a, n in zip(aliases, one.elements, strict=True) if a.root not in (n, None)
        )
        return (
            f"follows from {', '.join(self.syntax.symbol(root).text for root in roots if root)}"
            if roots
            else ""
        )

    def _values(self, one: Declared) -> str:
        if isinstance(one, FlatParameter):
            numbers = _listed(one, [self.syntax.number(self.dae.table.values[n]).text for n in one.elements])
            constant = all(v.is_constant() for v in one.value)
            return numbers if constant else f"{numbers} = {self._formulas(one, one.value)}"
        if one.kind == "propagated":
            return f"= {self._formulas(one, [self.flat.definitions[n] for n in one.elements])}"
        if one.start is None:
            return ""
        return self._formulas(one, one.start) + (", fixed" if one.fixed else "")

    def _formulas(self, one: Declared, values: Sequence[ca.SX]) -> str:
        """Expressions of the elements, or the one of a whole vector."""
        graph = WholeGraph(self.elements)
        with located(one.name):
            whole = graph.rows([[v] for v in values]) if len(values) > 1 else None
            text = written(whole or graph.read(values), self.syntax)
        where = [f"{name} = {value}" for name, value in text.definitions]
        texts = [e.text for e in text.expressions]
        return (texts[0] if whole else _listed(one, texts)) + (f" with {', '.join(where)}" if where else "")


def _listed(one: Declared, texts: Sequence[str]) -> str:
    """Texts of the elements, row after row; one for all where they are the same."""
    if len(set(texts)) == 1:
        return texts[0]
    if len(one.shape) == 1:
        return f"({', '.join(texts)})"
    rows = [", ".join(texts[k :: one.shape[0]]) for k in range(one.shape[0])]
    return f"({'; '.join(rows)})"


def links(prefix: str, numbers: Iterable[int], brackets: str) -> str:
    """Links to numbered places."""
    opening, closing = brackets
    return " ".join(f"<a href=#{prefix}{n}>{opening}{n}{closing}</a>" for n in numbers)
