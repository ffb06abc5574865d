"""The page of the thesis: its figures and tables, and the call that makes each here, from `thesis.toml`."""

import importlib
import os
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from notebooks.site.builder.generated.component_tables import table
from notebooks.site.builder.generated.reference_pages import resolver
from notebooks.site.builder.places import ROOT, SOURCES
from notebooks.site.builder.reading.docstrings import escaped
from notebooks.site.builder.reading.public_names import kind_of, public_names
from notebooks.site.builder.staging import handwritten

LAST = {
    2: 4,
    3: 10,
    4: 18,
    5: 24,
    6: 5,
    7: 18,
    8: 9,
}  # the highest number of a figure that is told of, by chapter
OPENING = """# The thesis: figures and tables

I. Dressler, "Modeling and Control of Stiff Robots for Flexible Manufacturing" (Lund University, 2012), and the call that
makes each of its figures and tables here, with the page where it is at work. Measured data of the thesis are not public:
pictures are of synthetic data, or of your own. What a figure shows is told as far as it is known here from the text.
"""
UNKNOWN = "not told of in what this project has of the thesis"


@dataclass(frozen=True)
class Item:
    """A figure or a table: number, subject, the call that makes it, names in it, a page, or why there is none."""

    kind: str
    number: str
    subject: str
    call: str = ""
    names: Sequence[str] = ()
    page: str = ""
    why: str = ""


@cache
def items() -> tuple[Item, ...]:
    """All of them by kind and number, those of which nothing is known too."""
    text = tomllib.loads((SOURCES / "thesis.toml").read_text(encoding="utf-8"))
    found = [
        Item(kind, number, **{key: row[key] for key in row if key != "numbers"})
        for kind in ("figure", "table")
        for row in text[kind]
        for number in row["numbers"]
    ]
    told = {one.number for one in found if one.kind == "figure"}
    numbers = [f"{chapter}.{k}" for chapter, last in LAST.items() for k in range(1, last + 1)]
    found += [Item("figure", number, "", why=UNKNOWN) for number in numbers if number not in told]
    return tuple(sorted(found, key=lambda one: (one.kind, *map(int, one.number.split(".")))))


def thesis_page() -> str:
    """The page in Markdown."""
    text = OPENING
    for kind, title in (("figure", "Figures"), ("table", "Tables")):
        held = [one for one in items() if one.kind == kind]
        made = sum(bool(one.call) for one in held)
        text += f"\n## {title}\n\nOf {len(held)} whose numbers are known here, {made} are made.\n\n"
        for chapter in dict.fromkeys(one.number.partition(".")[0] for one in held):
            rows = list(_rows([one for one in held if one.number.startswith(f"{chapter}.")]))
            text += f"### {title} of chapter {chapter}\n\n{table('', ('', 'what', 'call', 'see'), rows)}\n\n"
    return text


def _rows(held: list[Item]) -> Iterator[tuple[str, ...]]:
    """A row for the numbers that share all else; those of which nothing is known come last."""
    alike: dict[tuple[object, ...], list[Item]] = {}
    for one in sorted(held, key=lambda one: one.why == UNKNOWN):
        alike.setdefault((one.subject, one.call, *one.names, one.page, one.why), []).append(one)
    for several in alike.values():
        one = several[0]
        call = f"`{one.call}`" if one.call else escaped(one.why, resolver(""))
        links = ", ".join(_name(name) for name in one.names)
        numbers = ", ".join(item.number for item in several)
        yield numbers, escaped(one.subject), call + (f" ({links})" if links else ""), _page(one.page)


def _name(full: str) -> str:
    parent, _, name = full.rpartition(".")
    if any(one.full == parent and kind_of(one.value) == "module" for one in public_names()):
        return f"{{py:obj}}`{parent.rpartition('.')[2]}.{name} <{parent}>`"
    return f"{{py:obj}}`{'.'.join(_short(full))} <{full}>`"


def _short(full: str) -> list[str]:
    """The name without its packages and modules."""
    parts = full.split(".")
    first = next((k for k, part in enumerate(parts) if part[:1].isupper()), len(parts) - 1)
    return parts[first:]


def _page(path: str) -> str:
    if not path:
        return ""
    page = handwritten()[ROOT / path]
    way = os.path.relpath(page, "thesis")
    return f"[{page.rpartition('/')[2].partition('.')[0].replace('_', ' ')}]({way})"


def found(full: str) -> Any:
    """What a full name stands for; AttributeError or ModuleNotFoundError where there is none."""
    parts = full.split(".")
    for k in range(len(parts), 0, -1):
        try:
            value = importlib.import_module(".".join(parts[:k]))
        except ModuleNotFoundError:
            continue
        for part in parts[k:]:
            value = getattr(value, part)
        return value
    raise ModuleNotFoundError(full)
