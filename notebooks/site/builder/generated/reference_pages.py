"""Pages of the reference: for each task its public names with signature, docstring, members, tables of components."""

import dataclasses
import inspect
from collections.abc import Callable, Iterator, Mapping
from functools import cache, cached_property
from typing import Any

from gantrytau import Connector, Declared, Model
from notebooks.site.builder.gallery.drawn_examples import Drawn, shown_example
from notebooks.site.builder.generated.component_tables import component_tables, table
from notebooks.site.builder.reading.docstrings import escaped, markdown, summary
from notebooks.site.builder.reading.public_names import PublicName, kind_of, public_names, public_packages
from notebooks.site.builder.reading.signatures import arguments, result_of, signature
from notebooks.site.builder.reading.task_groups import TaskGroup, task_groups

OWN = ("gantrytau", "notebooks")  # packages whose methods are told


def reference_pages(drawn: Mapping[str, Drawn] | None = None) -> Iterator[tuple[str, str]]:
    """Paths below the root of the site and texts of all pages of the reference; drawn: examples by full names."""
    groups = task_groups()
    yield "reference/index.md", _index(groups)
    yield "reference/names.md", _all_names()
    for group in groups:
        if group.names:
            yield f"reference/{group.file}.md", group_page(group, drawn or {})


def _index(groups: tuple[TaskGroup, ...]) -> str:
    text = "# Reference\n\nEvery public name, by what it is for; [all names](names.md) by package and alphabet.\n"
    for part in dict.fromkeys(group.part for group in groups):
        held = [group for group in groups if group.part == part and group.names]
        if not held:
            continue
        files = "\n".join(group.file for group in held)
        rows = [(f"[{group.title}]({group.file}.md)", _names_in_a_row(group)) for group in held]
        text += f"\n## {part}\n\n" + table("", ("page", "names"), rows)
        text += f"\n\n```{{toctree}}\n:hidden:\n:caption: {part}\n\n{files}\n```\n"
    return text + "\n```{toctree}\n:hidden:\n\nnames\n```\n"


def _names_in_a_row(group: TaskGroup) -> str:
    return ", ".join(dict.fromkeys(reference(one) for one in group.names))


def reference(one: PublicName) -> str:
    """A link to a public name, as it is written without its package."""
    return f"{{py:obj}}`{one.name} <{one.same_as or one.full}>`"


def _all_names() -> str:
    text = "# All names\n\nWhat each package exports, with the sentence that opens its documentation.\n"
    for package in public_packages():
        names = sorted(
            (one for one in public_names() if one.package == package), key=lambda o: o.name.lower()
        )
        rows = [(reference(one), _sentence(one)) for one in names]
        text += f"\n## {package}\n\n{table('', ('name', 'what'), rows)}\n"
    return text


def _sentence(one: PublicName) -> str:
    return "a constant" if kind_of(one.value) == "data" else summary(inspect.getdoc(one.value))


def group_page(group: TaskGroup, drawn: Mapping[str, Drawn]) -> str:
    """The page of a task; drawn: examples by full names."""
    parts = [f"# {group.title}"]
    if group.synonyms:  # the search finds the page by them
        parts.insert(0, f"---\nmyst:\n  html_meta:\n    keywords: {', '.join(group.synonyms)}\n---")
    if group.words:
        parts.append(escaped(group.words, resolver("")))
    rows = [(reference(one), _sentence(one)) for one in group.names]
    parts.append(table("", ("name", "what"), rows))
    for one in group.names:
        parts.append(entry(one, drawn.get(one.full)))
    return "\n\n".join(parts) + "\n"


def entry(one: PublicName, example: Drawn | None) -> str:
    """The description of a public name as a directive of Sphinx, its members and its example within."""
    value, kind = one.value, kind_of(one.value)
    link = resolver(one.package)
    body = [f"```python\nfrom {one.package} import {one.name}\n```"]
    if kind in ("class", "exception"):
        body += list(_class_body(value, link, shown_example(example, "../gallery") if example else ""))
        known = (
            ""
            if issubclass(value, Declared) and value not in (Declared, Model, Connector)
            else signature(value)
        )
        head = f"{one.name}{known}"
    elif kind == "function":
        body.append(markdown(inspect.getdoc(value), arguments(value), link))
        head = one.name + signature(value)
    elif kind == "module":
        body.append(markdown(value.__doc__, (), link))
        body.append(_module_body(value, link))
        head = one.name
    else:
        body.append(_constant(value))
        head, kind = one.name, "data"
    title = f"## {one.name}\n\n```{{py:currentmodule}} {one.package}\n```\n\n"
    return title + directive("py:data" if kind == "module" else f"py:{kind}", head, body, 7)


def directive(name: str, head: str, body: list[str], colons: int, options: str = "") -> str:
    """A directive of MyST, fenced by so many colons."""
    fence = ":" * colons
    inner = "\n\n".join(part for part in body if part)
    return f"{fence}{{{name}}} {' '.join(head.split())}\n{options}\n{inner}\n{fence}"


def _class_body(cls: type, link: Callable[[str], str | None], example: str) -> Iterator[str]:
    bases = [base for base in cls.__bases__ if base.__module__.startswith(OWN) and link(base.__name__)]
    if bases:
        yield f"A {', '.join(f'{{py:obj}}`{base.__name__} <{link(base.__name__)}>`' for base in bases)}."
    doc = cls.__dict__.get("__doc__") or ""
    generated = dataclasses.is_dataclass(cls) and doc.startswith(f"{cls.__name__}(")
    if doc and not generated:
        yield markdown(doc, arguments(cls), link)
    yield example
    if issubclass(cls, Declared) and cls not in (Declared, Model, Connector):
        yield from component_tables(cls, link)
        return
    yield _fields_with_units(cls)
    for name, member in _members(cls):
        yield _member(name, member, link)


def _members(cls: type) -> Iterator[tuple[str, Any]]:
    """Methods and properties with documentation, its own and those of bases of the house, in order of writing."""
    seen = set[str]()
    for base in cls.__mro__:
        if not base.__module__.startswith(OWN):
            continue
        for name, member in vars(base).items():
            if name.startswith("_") or name in seen:
                continue
            seen.add(name)
            function = getattr(member, "__func__", getattr(member, "func", member))
            described = isinstance(member, property | cached_property) or inspect.isroutine(function)
            if described and _doc(member):
                yield name, member


def _doc(member: Any) -> str:
    return getattr(getattr(member, "__func__", member), "__doc__", "") or ""


def _member(name: str, member: Any, link: Callable[[str], str | None]) -> str:
    if isinstance(member, property | cached_property):
        getter = member.fget if isinstance(member, property) else member.func
        kind = result_of(property(getter))
        options = f":type: {kind}\n" if kind else ""
        return directive("py:property", name, [markdown(_doc(member), (), link)], 4, options)
    function = getattr(member, "__func__", member)
    flags = ":classmethod:\n" if isinstance(member, classmethod) else ""
    flags = ":staticmethod:\n" if isinstance(member, staticmethod) else flags
    body = [markdown(_doc(member), arguments(function), link)]
    return directive("py:method", name + signature(function), body, 4, flags)


def _fields_with_units(cls: type) -> str:
    """Fields of a record of quantities, which have a unit and a description of their own."""
    fields = dataclasses.fields(cls) if dataclasses.is_dataclass(cls) else ()
    rows = [
        (f"`{f.name}`", escaped(f.metadata["unit"]), escaped(f.metadata.get("description", "")))
        for f in fields
        if "unit" in f.metadata
    ]
    return table("Fields", ("name", "unit", "description"), rows)


def _module_body(module: Any, link: Callable[[str], str | None]) -> str:
    rows = []
    for name, value in vars(module).items():
        own = getattr(value, "__module__", "") == module.__name__
        if own and not name.startswith("_") and (inspect.isroutine(value) or isinstance(value, type)):
            rows.append((f"`{name}`", summary(inspect.getdoc(value), link)))
    return table("Holds", ("name", "what"), rows)


def _constant(value: Any) -> str:
    text = value if isinstance(value, str) else repr(value)
    shown = text if len(text) < 2000 else text[:2000] + "\n..."
    return f"```text\n{shown.strip()}\n```"


@cache
def resolver(package: str) -> Callable[[str], str | None]:
    """What finds the public name that a word between backticks is: of the package itself, or the only one of this name."""
    found: dict[str, set[str]] = {}
    for one in public_names():
        target = one.same_as or one.full
        found.setdefault(one.name, set()).add(target)
        found.setdefault(one.full, set()).add(target)
    own = {one.name: one.same_as or one.full for one in public_names() if one.package == package}

    def resolve(word: str) -> str | None:
        places = found.get(word, set())
        return own.get(word) or (next(iter(places)) if len(places) == 1 and len(word) > 2 else None)

    return resolve


def unplaced() -> list[str]:
    """Public names that no task of the list is for."""
    placed = {one.full for group in task_groups() for one in group.names}
    return [one.full for one in public_names() if not one.same_as and one.full not in placed]
