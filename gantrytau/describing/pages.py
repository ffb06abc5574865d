"""Pages of HTML, each complete in itself: head and style, tables, folded parts and the box of a verdict."""

from collections.abc import Iterable, Sequence
from html import escape

STYLE = """
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1.5rem; }
table { border-collapse: collapse; font-size: .9rem; margin: .5rem 0 1.5rem; }
th, td { text-align: left; vertical-align: top; padding: .15rem .8rem .15rem 0; border-bottom: 1px solid #8886; }
td:first-child, code, pre { font-family: ui-monospace, monospace; }
.numbers :is(th, td):not(:first-child) { text-align: right; }
pre { overflow-x: auto; padding: .6rem; border: 1px solid #8886; }
summary { cursor: pointer; }
.verdict { border-left: .5rem solid #3a3; padding: .2rem 1rem; background: #3a32; }
.bad { border-color: #c33; background: #c332; }
"""
PART = """
.gantrytau :is(h4, p) { margin: .6rem 0 .2rem; }
.gantrytau table { border-collapse: collapse; margin: .2rem 0; }
.gantrytau :is(th, td) { text-align: left; vertical-align: top; padding: .1rem .9rem .1rem 0; }
.gantrytau :is(td:first-child, pre) { font-family: ui-monospace, monospace; }
.gantrytau pre { white-space: pre-wrap; }
"""


def page(title: str, parts: Iterable[str], style: str = "") -> str:
    """A page of these parts; title: text; style: rules besides those of all pages."""
    head = (
        '<meta charset="utf-8"><meta name="viewport" content="width=device-width">'
        f"<title>{escape(title)}</title><style>{STYLE}{style}</style>"
    )
    body = "\n".join(filter(None, parts))
    return f'<!DOCTYPE html>\n<html lang="en"><head>{head}</head><body>\n{body}\n</body></html>\n'


def fragment(parts: Iterable[str]) -> str:
    """A part of somebody else's page, such as the output of a cell of a notebook, with the same tables."""
    body = "\n".join(filter(None, parts))
    return f'<div class="gantrytau"><style>{PART}</style>\n{body}\n</div>'


def table(
    head: Iterable[str], rows: Iterable[Iterable[str]], kind: str = "", marks: Sequence[str] | None = None
) -> str:
    """A table of texts. kind: its class, "numbers" to have them at the right; marks: of each row, such as `id="x"`."""
    lines = ["".join(f"<td>{escape(cell, quote=False)}</td>" for cell in row) for row in rows]
    top = "".join(f"<th>{escape(cell, quote=False)}</th>" for cell in head)
    opened = [f"<tr {mark}>" if mark else "<tr>" for mark in marks or [""] * len(lines)]
    body = "\n".join(f"{tr}{line}</tr>" for tr, line in zip(opened, lines, strict=True))
    first = f'<table class="{kind}">' if kind else "<table>"
    return f"{first}\n{f'<tr>{top}</tr>' if top else ''}\n{body}\n</table>"


def folded(summary: str, parts: Iterable[str], opened: bool = False) -> str:
    """What is shown when its summary is clicked, both HTML."""
    return "\n".join(
        [f"<details{' open' * opened}><summary>{summary}</summary>", *filter(None, parts), "</details>"]
    )


def verdict(good: bool, heading: str, reasons: Iterable[str]) -> str:
    """The box of a verdict, green or red, with its reasons as texts."""
    said = "".join(f"<p>{escape(reason)}</p>" for reason in reasons)
    return f'<div class="verdict{"" if good else " bad"}"><h2>{escape(heading)}</h2>{said}</div>'
