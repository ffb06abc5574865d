"""Reads the page of equations back: formulas as programs, names by the rows of the table to which they lead."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from html.parser import HTMLParser
from typing import Any

import numpy as np

from gantrytau.language.symbols import derivative_name

LOWERED = str.maketrans("₀₁₂₃₄₅₆₇₈₉", "0123456789")
SIGNS = str.maketrans({"−": "-", "·": "*", "\u00a0": " ", "\u2060": "", "≤": "<=", "≥": ">=", "≠": "!="})
WORDS = {" =\u00a0": " == ", "∧": " and ", "∨": " or ", "¬": " not ", "√(": "sqrt("}
FUNCTIONS = {
    n: getattr(np, n) for n in ("sin", "cos", "tan", "exp", "sqrt", "sinh", "cosh", "tanh", "floor", "ceil")
}
FUNCTIONS |= {
    "arcsin": np.arcsin,
    "arccos": np.arccos,
    "arctan": np.arctan,
    "ln": np.log,
    "sgn": np.sign,
    "abs": abs,
}
FUNCTIONS |= {"atan2": np.arctan2, "min": np.minimum, "max": np.maximum, "hypot": np.hypot, "mod": np.fmod}
DOTS = {"\u0307": 1, "\u0308": 2}


@dataclass
class Element:
    """A tag with what is in it."""

    tag: str
    attributes: dict[str, str | None]
    inside: "list[Element | str]" = field(default_factory=list)

    @property
    def text(self) -> str:
        """All letters in it."""
        return "".join(x if isinstance(x, str) else x.text for x in self.inside)

    def find(self, *tags: str) -> "list[Element]":
        """All elements of these tags in it, of any without them."""
        deep = [x for x in self.inside if isinstance(x, Element)]
        return [found for x in deep for found in ([x] if x.tag in tags or not tags else []) + x.find(*tags)]

    def values(self, key: str) -> list[str]:
        """The values of an attribute."""
        return [x.attributes[key] or "" for x in self.find() if key in x.attributes]


class Reader(HTMLParser):
    """A tree of elements; ends that go without saying are found as browsers find them."""

    closes = {"p": ("p",), "td": ("td", "th"), "th": ("td", "th"), "tr": ("td", "th", "tr")}
    ends = {"p", "details", "table", "h2", "script"}

    def __init__(self, text: str):
        super().__init__()
        self.root = Element("page", {})
        self.open = [self.root]
        self.feed(text)
        self.close()
        assert self.open == [self.root]

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        closed = self.closes.get(tag, ("p",) if tag in self.ends else ())
        while self.open[-1].tag in closed:
            self.open.pop()
        self.open[-1].inside.append(element := Element(tag, dict(attrs)))
        if tag not in ("meta", "br"):
            self.open.append(element)

    def handle_endtag(self, tag: str) -> None:
        while self.open[-1].tag in ("p", "td", "th", "tr") and self.open[-1].tag != tag:
            self.open.pop()
        assert self.open.pop().tag == tag

    def handle_data(self, data: str) -> None:
        self.open[-1].inside.append(data)


@dataclass(frozen=True)
class Quantity:
    """A row of the table."""

    name: str
    cells: tuple[str, ...]


@dataclass(frozen=True)
class Formula:
    """The two sides of a line, as programs."""

    left: str
    right: str


@dataclass(frozen=True)
class Part:
    """Formulas that share abbreviations. mark: the anchor of a block or component, or the words above, or ""."""

    mark: str
    formulas: list[Formula]


class PageOfEquations:
    """What a page says: the rows of its table, by anchor, and its formulas, by heading of level two."""

    def __init__(self, text: str):
        tree = Reader(text).root
        rows = [row for row in tree.find("tr") if row.attributes.get("id")]
        cells = {row.attributes["id"]: tuple(cell.text.strip() for cell in row.find("td")) for row in rows}
        self.quantities = {f"#{mark}": Quantity(texts[0], texts) for mark, texts in cells.items()}
        self.parts: dict[str, list[Part]] = {}
        self.summaries: list[str] = []
        (body,) = tree.find("body")
        heading = ""
        for element in body.inside:
            if isinstance(element, str):
                continue
            if element.tag == "h2":
                heading = element.text
                self.parts[heading] = []
            elif element.tag == "details" and heading:
                (summary,) = element.find("summary")
                mark = summary.find("b")[0].attributes.get("id") or ""
                lines = [self._formula(p) for p in element.find("p") if " = " in p.text]
                self.parts[heading].append(Part(mark, lines))
                self.summaries.append(summary.text)
            elif element.tag == "p":
                self._line(element, self.parts[heading])

    def _line(self, paragraph: Element, parts: list[Part]) -> None:
        """A line outside of folded parts: the first of a part, or one more."""
        mark = paragraph.attributes.get("id") or ""
        if paragraph.attributes.get("class") == "from":
            parts.append(Part(paragraph.text.strip(), []))
        elif " = " in paragraph.text or mark:
            if mark or not parts:
                parts.append(Part(mark, []))
            parts[-1].formulas.append(self._formula(paragraph))

    def _formula(self, paragraph: Element) -> Formula:
        inside = [x for x in paragraph.inside if isinstance(x, str) or x.tag not in ("small", "span")]
        left, right = self._program(inside).strip().split(" = ", 1)
        return Formula(left, right)

    def _program(self, inside: "list[Element | str]") -> str:
        text = "".join(_plain(x) if isinstance(x, str) else self._element(x) for x in inside)
        text = re.sub(r"\|([^|]*)\|", r"abs(\1)", text)
        return _choices(text)

    def _element(self, element: Element) -> str:
        tag, inside = element.tag, [x for x in element.inside if isinstance(x, Element)]
        if tag == "a":
            return f"N[{self._name(element)!r}]"
        if tag == "i":
            return f"N[{element.text!r}]"
        if tag == "sup":
            return f"**({self._program(element.inside)})"
        if tag == "mfrac":
            above, below = (self._program(x.inside) for x in inside)
            return f"(({above})/({below}))"
        if tag == "msqrt":
            return f"sqrt({self._program(element.inside)})"
        if tag == "b":
            return f" {element.text.upper()} "
        if tag == "mtable":
            *cases, (last, _) = (
                [self._element(cell) for cell in row.inside if isinstance(cell, Element)] for row in inside
            )
            for value, condition in reversed(cases):
                last = f"({value} if {condition.removeprefix('if ')} else {last})"
            return last
        return self._program([x for x in element.inside if not (isinstance(x, Element) and x.text == "{")])

    def _name(self, link: Element) -> str:
        """The name in the model: that of the row, of the element that is shown, as often differentiated as is shown."""
        whole = self.quantities[link.attributes["href"] or ""].name
        if "(" in whole:
            return whole
        rate = [x for x in link.inside if isinstance(x, Element) and x.tag == "b"]
        shown = "".join(
            x if isinstance(x, str) else "" if x.tag == "b" else f"_{x.text}" for x in link.inside
        )
        power = re.fullmatch(r"d(\d?)/dt\1", rate[0].text) if rate else None
        order = (int(power[1] or 1) if power else 0) + sum(shown.count(dot) * n for dot, n in DOTS.items())
        path = shown.strip("\u00a0").rpartition(".")[0].lstrip(".")
        assert f".{whole}".rpartition(".")[0].endswith(path), (whole, shown)
        indices = re.search(r"([₀-₉]+|_[\d,]+)$", shown)
        own = re.search(r"(?<=[A-Za-z])(\d+)$|_(\d+)$", whole)  # q1, v_0
        element = (
            "" if indices is None or own is not None else f"[{indices[0].translate(LOWERED).strip('_')}]"
        )
        mixed = re.search(r",(\d+)$", shown) if indices is None else None
        return derivative_name(whole + (f"[{mixed[1]}]" if mixed else element), order)

    def values(self, part: Part, numbers: Mapping[str, Any]) -> list[tuple[Formula, Any, Any]]:
        """The formulas of a part that are no abbreviations, with the values of both sides."""
        shared = {f.left: f.right for f in part.formulas if f.left.startswith("S")}
        known: dict[str, Any] = {}

        class Names(dict[str, Any]):
            def __missing__(self, key: str) -> Any:
                if key not in known:
                    known[key] = evaluate(shared[key])
                return known[key]

        def evaluate(program: str) -> Any:
            with np.errstate(all="ignore"):
                return eval(program, {"__builtins__": {}}, Names(N=numbers, inf=np.inf, **FUNCTIONS))

        return [(f, evaluate(f.left), evaluate(f.right)) for f in part.formulas if f.left not in shared]


def _plain(text: str) -> str:
    for sign, word in WORDS.items():
        text = text.replace(sign, word)
    text = re.sub("Σ([₀-₉]+)", lambda found: "S" + found[1].translate(LOWERED), text)
    return text.translate(SIGNS).replace("∞", "inf")


def _choices(text: str) -> str:
    """Choices in words as Python has them, the innermost first; they end where the parentheses around them do."""
    while " IF " in text:
        start = text.rindex(" IF ")
        condition, _, rest = text[start + 4 :].partition(" THEN ")
        value, _, rest = rest.partition(" ELSE ")
        depth = 0
        for end, letter in enumerate(rest + ")"):
            depth += (letter == "(") - (letter == ")")
            if depth < 0:
                text = f"{text[:start]}({value} if {condition} else {rest[:end]}){rest[end:]}"
                break
    return text
