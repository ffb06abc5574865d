"""The tasks by which the reference and the catalogue of errors are ordered, as `reference.toml` lists them.

What belongs to a task follows from where it is written: of all the homes in the list, the longest that a module stands in
says its task. A new name in an old file has its place without anybody's help.
"""

import tomllib
from dataclasses import dataclass, field, replace
from functools import cache

from notebooks.site.builder.places import SOURCES
from notebooks.site.builder.reading.public_names import PublicName, public_names


@dataclass(frozen=True)
class TaskGroup:
    """A page of the reference: its part of the site, file, title, an opening, the modules that it is about, and what other
    tools call its names.
    """

    part: str
    file: str
    title: str
    words: str
    homes: tuple[str, ...]
    synonyms: tuple[str, ...] = ()
    names: tuple[PublicName, ...] = field(default=())


@cache
def listed_groups() -> tuple[TaskGroup, ...]:
    """The tasks as they are listed, without names."""
    table = tomllib.loads((SOURCES / "reference.toml").read_text(encoding="utf-8"))
    return tuple(
        TaskGroup(
            part["title"],
            one["file"],
            one["title"],
            one.get("words", ""),
            tuple(one["homes"]),
            tuple(one.get("synonyms", ())),
        )
        for part in table["part"]
        for one in part["group"]
    )


def group_of(module: str) -> TaskGroup | None:
    """The task that a module is for, or None where no home is listed for it."""
    found = [
        (len(home), group)
        for group in listed_groups()
        for home in group.homes
        if f"{module}.".startswith(f"{home}.")
    ]
    return max(found, key=lambda pair: pair[0])[1] if found else None


@cache
def task_groups() -> tuple[TaskGroup, ...]:
    """The tasks with their public names in the order of the homes, and of the lines in these."""
    found = []
    for group in listed_groups():
        names = [one for one in public_names() if group_of(one.home) == group and not one.same_as]
        names.sort(key=lambda one: (_place(group, one.home), one.home, one.line))
        found.append(replace(group, names=tuple(names)))
    return tuple(found)


@cache
def page_of(full: str) -> str:
    """The file of the page that a public name stands on, by its full name."""
    return next(group.file for group in task_groups() for one in group.names if one.full == full)


def _place(group: TaskGroup, module: str) -> int:
    return max(
        (k for k, home in enumerate(group.homes) if f"{module}.".startswith(f"{home}.")),
        key=lambda k: len(group.homes[k]),
    )
