"""Tables of a component, as `describe` tells of it: parameters, connectors, variables, parts."""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence

from gantrytau import describe
from notebooks.site.builder.reading.docstrings import escaped

BAR = re.compile(r"(?<!\\)\|")  # which would end a cell
CODE = {"name", "value", "class", "with"}  # columns of names and values


def component_tables(cls: type, link: Callable[[str], str | None]) -> Iterator[str]:
    """Tables in Markdown with their headings. link: from a name to the full one that is linked, or None."""
    for listing in describe(cls).tables:
        if not listing.rows:
            continue
        cells = [
            [_cell(head, text, link) for head, text in zip(listing.columns, row, strict=True)]
            for row in listing.rows
        ]
        yield table(listing.heading, listing.columns, cells)


def table(heading: str, columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown below its heading, without columns that are empty; "" without rows."""
    lines = [tuple(BAR.sub(r"\\|", cell.replace("\n", " ")) for cell in row) for row in rows]
    if not lines:
        return ""
    kept = [k for k, _ in enumerate(columns) if k == 0 or any(row[k] for row in lines)]
    body = [tuple(columns), ("---",) * len(columns), *lines]
    text = "\n".join(f"| {' | '.join(row[k] for k in kept)} |" for row in body)
    return f"**{heading}**\n\n{text}" if heading else text


def _cell(head: str, text: str, link: Callable[[str], str | None]) -> str:
    if head not in CODE or not text or text.startswith("("):
        return escaped(text, link)
    target = link(text) if head == "class" else None
    return f"{{py:obj}}`{text} <{target}>`" if target else f"`{text}`"
