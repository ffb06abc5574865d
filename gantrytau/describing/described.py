"""The record of what is said of a thing: a sentence, facts, tables; as text, as HTML for notebooks, as a mapping."""

import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

from gantrytau.describing.pages import fragment, table

SHOWN = 40  # rows of a table that are shown
WIDTH = 120  # letters of a line
PLAIN = {"name", "value", "unit", "class", "description"}  # columns that need no head in a text
WIDEST = 52  # letters of a column that is not the last


@dataclass(frozen=True)
class Listing:
    """A table with its heading. columns: their heads, the first is a name; rows: texts; beyond: what tells of the rest."""

    heading: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    @classmethod
    def of(cls, heading: str, columns: Iterable[str], rows: Iterable[Iterable[str]]) -> "Listing":
        """The same without columns, but the first, that are empty."""
        columns, texts = tuple(columns), [tuple(row) for row in rows]
        kept = [k for k, _ in enumerate(columns) if k == 0 or any(row[k] for row in texts)]
        return cls(
            heading, tuple(columns[k] for k in kept), tuple(tuple(row[k] for k in kept) for row in texts)
        )

    @property
    def left(self) -> str:
        """Words for rows that are not shown."""
        more = len(self.rows) - SHOWN
        return f"... and {more} more" if more > 0 else ""

    def lines(self) -> list[str]:
        """As text, each column as wide as it needs, the last one wrapped."""
        told = any(head not in PLAIN for head in self.columns)
        heads = (self.heading, *(self.columns[1:] if told else [""] * (len(self.columns) - 1)))
        shown = [heads, *(("  " + row[0], *row[1:]) for row in self.rows[:SHOWN])]
        widths = [min(max(len(row[k]) for row in shown), WIDEST) for k in range(len(self.columns) - 1)]
        found = []
        for row in shown:
            start = "".join(f"{cell:{width}}  " for cell, width in zip(row, widths, strict=False))
            found += _wrapped(start, row[-1])
        return [*found, *([f"  {self.left}"] if self.left else [])]

    def html(self) -> str:
        """As HTML."""
        below = f"<p>{escape(self.left)}</p>" if self.left else ""
        return f"<h4>{escape(self.heading)}</h4>{table(self.columns, self.rows[:SHOWN])}{below}"


@dataclass(frozen=True, repr=False)
class Description:
    """What is said of a thing. It prints itself; notebooks show it as tables.

    title: its name; kind: what it is; summary: the first sentence of its documentation; facts: further words by name;
    tables: of parameters, variables, fields; text: what the thing prints of itself, if it does.
    """

    title: str
    kind: str
    summary: str = ""
    facts: tuple[tuple[str, str], ...] = ()
    tables: tuple[Listing, ...] = field(default=())
    text: str = ""

    def __str__(self) -> str:
        heads = [f"{self.title}: {self.kind}" if self.kind else self.title]
        heads += textwrap.wrap(self.summary, WIDTH)
        for name, words in self.facts:
            heads += _wrapped(f"{name}: ", words)
        parts = [heads, self.text.splitlines(), *(rows.lines() for rows in self.tables if rows.rows)]
        return "\n\n".join("\n".join(line.rstrip() for line in lines) for lines in parts if lines)

    __repr__ = __str__

    def html(self) -> str:
        """As a part of a page."""
        kind = f": {escape(self.kind)}" if self.kind else ""
        facts = "".join(f"<p>{escape(name)}: {escape(words)}</p>" for name, words in self.facts)
        return fragment(
            [
                f"<p><strong>{escape(self.title)}</strong>{kind}</p>",
                f"<p>{escape(self.summary)}</p>" if self.summary else "",
                facts,
                f"<pre>{escape(self.text)}</pre>" if self.text else "",
                *(rows.html() for rows in self.tables if rows.rows),
            ]
        )

    def _repr_html_(self) -> str:
        return self.html()

    def as_mapping(self) -> dict[str, Any]:
        """All of it, no row left out, of texts, lists and mappings; keys of rows are the heads of columns."""
        tables = {
            rows.heading: [dict(zip(rows.columns, row, strict=True)) for row in rows.rows]
            for rows in self.tables
        }
        told = {"title": self.title, "kind": self.kind, "summary": self.summary, **dict(self.facts)}
        return told | ({"text": self.text} if self.text else {}) | tables


def _wrapped(start: str, words: str) -> Sequence[str]:
    """Words behind a start, in further lines below where they begin."""
    indent = min(len(start), WIDTH // 2)
    lines = textwrap.wrap(words, max(WIDTH - len(start), 30), break_long_words=False) or [""]
    return [start + lines[0], *(" " * indent + line for line in lines[1:])]
