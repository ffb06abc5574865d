"""The pages of the thesis: figures and tables, the call that makes each here, and what it gave when the pages were built."""

import importlib
import os
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from typing import Any

from notebooks.site.builder.generated.component_tables import table
from notebooks.site.builder.generated.reference_pages import resolver
from notebooks.site.builder.places import ROOT
from notebooks.site.builder.reading.docstrings import escaped
from notebooks.site.builder.reading.public_names import kind_of, public_names
from notebooks.site.builder.staging import handwritten
from notebooks.site.builder.thesis_runs import BEGIN, DRAWING, Item, Made, Printed, code_before, items

OPENING = """# The thesis: figures and tables

I. Dressler, "Modeling and Control of Stiff Robots for Flexible Manufacturing" (Lund University, 2012): {figures} figures, of
which {data} have data and {drawings} are photos and drawings, and {tables} tables. {made} figures and {made_tables} tables
are made here by calls that run when these pages are built; what each gives stands beside the printed numbers. Measured data
of the thesis are not public: pictures are of synthetic data. Subjects of figures are in our words, and examples are small
where the thesis' size takes long.

Each number here is *found* by the toolkit, *given* to it as the thesis prints it, *assumed* where the thesis prints none, or
*fitted* to the printed one. A number that is given or fitted shows agreement with itself only.
"""
TITLES = {
    "1": "Introduction",
    "2": "Prototypes and workspace",
    "3": "Modelling and optimisation",
    "4": "Kinematics",
    "5": "Calibration",
    "6": "Dynamics",
    "7": "Iterative learning control",
    "8": "Lead-through",
    "A": "Appendix",
}


def thesis_pages(made: Mapping[Item, Made]) -> Iterator[tuple[str, str]]:
    """Pages in Markdown by their path below the root of the site."""
    chapters = dict.fromkeys(one.chapter for one in sorted(items(), key=lambda one: one.chapter))
    yield "thesis/index.md", _index(list(chapters))
    for chapter in chapters:
        yield f"thesis/chapter_{chapter}.md", _chapter(chapter, made)


def pictures(item: Item, one: Made) -> list[str]:
    """Names of pictures beside the pages."""
    return [f"{item.kind}_{item.number.replace('.', '_')}_{k}.png" for k in range(len(one.pictures))]


def _index(chapters: list[str]) -> str:
    figures, tables = ([one for one in items() if one.kind == kind] for kind in ("figure", "table"))
    drawings = sum(_is_drawing(one) for one in figures)
    counts = dict(figures=len(figures), data=len(figures) - drawings, drawings=drawings, tables=len(tables))
    ran = dict(made=sum(bool(one.call) for one in figures), made_tables=sum(bool(one.call) for one in tables))
    text = OPENING.format(**counts, **ran)
    for title, held in (("Figures", figures), ("Tables", tables)):
        text += f"\n## {title}\n\n{table('', ('', 'what', 'here'), list(_lines(held)))}\n"
    names = "\n".join(f"chapter_{chapter}" for chapter in chapters)
    return f"{text}\n```{{toctree}}\n:hidden:\n\n{names}\n```\n"


def _is_drawing(one: Item) -> bool:
    return one.why.startswith(DRAWING)


def _lines(held: list[Item]) -> Iterator[tuple[str, ...]]:
    """A row for each number, and one for neighbours that share all else."""
    alike: dict[tuple[object, ...], list[Item]] = {}
    for one in held:
        alike.setdefault((one.chapter, one.subject, one.call, one.why), []).append(one)
    for several in alike.values():
        one = several[0]
        here = "run" if one.call else escaped(one.why, resolver(""))
        numbers = ", ".join(item.number for item in several)
        link = f"[{numbers}](chapter_{one.chapter}.md)"
        yield link, escaped(one.subject), here


def _chapter(chapter: str, made: Mapping[Item, Made]) -> str:
    text, shown = f"# {TITLES[chapter]}\n\n", set[str]()
    if any(one.call for one in items() if one.chapter == chapter):
        text += f"```python\n{BEGIN.strip()}\n```\n\n"
    for kind, title in (("figure", "Figures"), ("table", "Tables")):
        held = [one for one in items() if one.kind == kind and one.chapter == chapter]
        text += f"## {title}\n\n" if held else ""
        done = set[str]()
        for one in held:
            if one.call and one.call in done:
                continue
            same = [other for other in held if other.call == one.call] if one.call else [one]
            done.add(one.call)
            numbers = ", ".join(item.number for item in same)
            text += (
                f"### {kind.title()} {numbers}: {escaped(one.subject)}\n\n{_told(one, made.get(one), shown)}"
            )
    return text


def _told(item: Item, one: Made | None, shown: set[str]) -> str:
    """The thesis' words, the call, its picture or text, and numbers beside those printed."""
    link = resolver("")
    said = f"{escaped(item.said, link)}\n\n" if item.said else ""
    why = f"{escaped(item.why, link)[:1].upper()}{escaped(item.why, link)[1:]}.\n\n" if item.why else ""
    if not item.call:
        names = ", ".join(map(_name, item.names))
        return said + why + (f"See {names}.\n\n" if names else "")
    before = [code.strip() for name, code in code_before(item).items() if name not in shown]
    shown.update(code_before(item))
    text = f"{said}{why}```python\n{chr(10).join([*before, item.call.strip()])}\n```\n\n"
    if one:
        for name in pictures(item, one):
            alt = f"{item.kind} {item.number}"
            scene = f"```{{image}} {name}\n:alt: {alt}\n:class: scene\n```\n\n"
            text += scene if item.scene else f"![{alt}]({name})\n\n"
        text += f"```text\n{one.text}\n```\n\n" if one.text else ""
        text += _numbers(item.printed, one.values) if item.printed else ""
    see = ", ".join([*map(_name, item.names), *filter(None, [_page(item.page)])])
    small = f"{escaped(item.small, link)}\n\n" if item.small else ""
    return text + small + (f"See {see}.\n\n" if see else "")


def _numbers(printed: Sequence[Printed], values: Sequence[float]) -> str:
    rows = []
    for one, value in zip(printed, values, strict=True):
        ends = one.thesis if isinstance(one.thesis, Sequence) else [one.thesis]
        unit = "" if one.unit == "1" else f" {one.unit}"
        off = one.off(value)
        inside = (
            "inside"
            if len(ends) > 1 and not off
            else f"{100 * off:+.1f} %"
            if any(ends)
            else f"{off:+.2g}{unit}"
        )
        told = " to ".join(f"{end:.5g}" for end in ends)
        rows.append((escaped(one.what), f"{told}{unit}", f"{value:.4g}{unit}", inside, one.origin))
    return table("", ("", "thesis", "here", "difference", "our number is"), rows) + "\n\n"


@cache
def _modules() -> frozenset[str]:
    return frozenset(one.full for one in public_names() if kind_of(one.value) == "module")


def _name(full: str) -> str:
    parent, _, name = full.rpartition(".")
    if parent in _modules():
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
