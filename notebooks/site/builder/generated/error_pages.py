"""Pages of the catalogue of messages: by the task of the module that makes them, then by class."""

from collections.abc import Iterator
from itertools import groupby

from notebooks.site.builder.generated.component_tables import table
from notebooks.site.builder.generated.reference_pages import resolver
from notebooks.site.builder.reading.docstrings import escaped, markdown
from notebooks.site.builder.reading.error_catalogue import Message, error_classes, messages
from notebooks.site.builder.reading.task_groups import TaskGroup, group_of, listed_groups

OPENING = """# Messages and what to do

Every message that the toolkit makes, collected from its sources. ⟨Words in brackets⟩ stand for what is put there: a path,
a value, a name; square brackets for what is said only sometimes. The second column is what the message itself says to do,
or what it expected. Search for a few words of a message: it is on one of these pages.
"""
GENERAL = """## In general

- `name: found argument=value, expected ...`: the argument of a function is no word of its list, no number within its limits,
  of another shape, or not finite. These are checked alike everywhere and stand on no page; what an argument takes stands in
  the reference. Words are case-sensitive; a text brings its unit, "700 mm", where a quantity has one.
- An error that has to do with one argument carries its name, `error.argument`; the command line names its option.
- `InitializationError`: begin near a pose that exists, by `Start(...)`; `check(model)` says what had to move, and what is
  missing.
- `StructureError`: count unknowns and equations with `check(model)`; what is undetermined needs an equation, a
  `Fixed(...)` or an input; what is determined twice needs one source less.
- `SolveError`: look at `error.result` or `error.optimum`, what was until then, and at `error.equations`, what degenerates.
"""


def error_pages() -> Iterator[tuple[str, str]]:
    """Paths below the root of the site and texts of all pages of the catalogue."""
    held = by_task()
    yield "messages/index.md", _index(held)
    for group, found in held.items():
        yield f"messages/{group.file}.md", _page(group, found)


def by_task() -> dict[TaskGroup, list[Message]]:
    """The messages of each task that has some, in the order of the tasks."""
    found: dict[TaskGroup, list[Message]] = {group: [] for group in listed_groups()}
    for message in messages():
        group = group_of(message.module)
        if group is None:
            raise ValueError(
                f"{message.module}: expected a task in reference.toml; add it to the homes of one"
            )
        found[group].append(message)
    return {group: held for group, held in found.items() if held}


def _index(held: dict[TaskGroup, list[Message]]) -> str:
    link = resolver("gantrytau")
    rows = [(f"[{group.title}]({group.file}.md)", str(len(found))) for group, found in held.items()]
    used = {message.kind for found in held.values() for message in found}
    kinds = sorted((name, words) for name, words in error_classes().items() if name in used)
    classes = [(_name(name), escaped(words, link)) for name, words in kinds]
    parts = [
        OPENING,
        table("", ("messages about", "how many"), rows),
        GENERAL.strip(),
    ]
    parts += ["## Classes", table("", ("class", "what it is"), classes)]
    files = "\n".join(group.file for group in held)
    return "\n\n".join(parts) + f"\n\n```{{toctree}}\n:hidden:\n\n{files}\n```\n"


def _page(group: TaskGroup, found: list[Message]) -> str:
    text = f"# Messages: {group.title}\n"
    if group.words:
        text += f"\n{markdown(group.words, (), resolver(''))}\n"
    ordered = sorted(found, key=lambda message: message.kind)
    for kind, held in groupby(ordered, key=lambda message: message.kind):
        rows = list(dict.fromkeys((_cell(m.said), _cell(m.remedy), _from(m)) for m in held))
        text += f"\n## {kind}\n\n" + table("", ("message", "what to do", "argument"), rows) + "\n"
    return text


def _from(message: Message) -> str:
    return f"`{message.argument}`" if message.argument else ""


def _cell(text: str) -> str:
    return escaped(text.replace("`", "'"))


def _name(kind: str) -> str:
    found = resolver("gantrytau")(kind)
    return f"{{py:obj}}`{kind} <{found}>`" if found else f"`{kind}`"
