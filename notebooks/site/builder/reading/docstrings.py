"""Docstrings as they are written here, to Markdown: paragraphs, arguments `name: words`, tables, lists, code.

Nothing is left out and no word is changed; whatever Markdown would take for markup, and is none, is escaped.
"""

import inspect
import re
from collections.abc import Callable, Collection, Iterator

CODE = re.compile(r"(``.+?``|`[^`]+`)")
MARKUP = re.compile(r"([\\*_<>\[\]{}$~|])")
ITEM = re.compile(r"(- |\d+\. )")
NAME = r"`?\*{0,2}\w+`?"
EXPLAINED = re.compile(rf"(?:^|(?<=; )|(?<=\. ))({NAME}(?:(?:, | and ){NAME})*): ")
FULL = 100  # letters of a line that leaves no room for another word
ERROR = re.compile(r"\b([A-Z][A-Za-z]+(?:Error|Result))\b")
SENTENCE = re.compile(r"(Raises|Warns|Returns|Needs)\b")

Link = Callable[[str], str | None]  # from what stands between backticks to the full name of which it is one


def markdown(text: str | None, names: Collection[str] = (), link: Link = lambda word: None) -> str:
    """A docstring as Markdown. names: arguments and fields, whose explanations become a list; link: see `Link`."""
    lines = inspect.cleandoc(text or "").splitlines()
    return "\n\n".join(_block(kind, part, set(names), link) for kind, part in _blocks(lines))


def summary(text: str | None, link: Link = lambda word: None) -> str:
    """The first sentence of a docstring as Markdown in one line."""
    paragraph = " ".join(inspect.cleandoc(text or "").partition("\n\n")[0].split())
    found = re.match(r"(.*?[.?!])(?= [A-Z`]|$)", paragraph)
    return escaped(found[1] if found else paragraph, link)


def escaped(text: str, link: Link = lambda word: None) -> str:
    """A text with its code kept, linked where that is a public name, and all else taken literally."""
    parts = []
    for k, part in enumerate(CODE.split(text)):
        if k % 2 == 0:
            words = ERROR.split(MARKUP.sub(r"\\\1", part))
            parts += [_error(word, link) if i % 2 else word for i, word in enumerate(words)]
            continue
        word = part.strip("`")
        target = link(word)
        parts.append(f"{{py:obj}}`{word} <{target}>`" if target and not set(word) & set("<>`") else part)
    found = "".join(parts)
    return re.sub(r"^(\d+)([.)])|^([#+=-])", lambda m: f"{m[1]}\\{m[2]}" if m[1] else f"\\{m[3]}", found)


def _error(word: str, link: Link) -> str:
    target = link(word)
    return f"{{py:obj}}`{word} <{target}>`" if target else word


def _blocks(lines: list[str]) -> Iterator[tuple[str, list[str]]]:
    """Runs of lines that belong together, with their kinds: "code", "table", "list" or "text"."""
    kind, part = "", list[str]()
    fenced = False
    for line in [*lines, ""]:
        if line.startswith("```"):
            fenced = not fenced
            if fenced:
                if part:
                    yield kind, part
                kind, part = "code", []
            else:
                yield "code", part
                kind, part = "", []
            continue
        if fenced:
            part.append(line)
            continue
        now = _kind(line, kind, part)
        if now != kind or (now == "text" and part and _begins(line, part[-1])):
            if part and kind:
                yield kind, part
            kind, part = now, []
        if now:
            part.append(line)
    if part and kind:
        yield kind, part


def _begins(line: str, before: str) -> bool:
    """Whether a line begins a paragraph: by its word, or behind a sentence that left room for it."""
    room = len(before) + 1 + len(line.split()[0]) < FULL
    return bool(SENTENCE.match(line)) or (before.endswith(".") and room and line[0].isupper())


def _kind(line: str, before: str, part: list[str]) -> str:
    if not line.strip():
        return "code" if before == "code" and part else ""
    if line.startswith("    ") and before in ("", "code"):
        return "code"
    if re.match(r"\|.*\|\s*$", line):
        return "table"
    if ITEM.match(line) or (before == "list" and line.startswith("  ")):
        return "list"
    return "code" if line.startswith("    ") and before == "text" and part[-1].endswith(":") else "text"


def _block(kind: str, lines: list[str], names: set[str], link: Link) -> str:
    if kind == "code":
        indent = min(len(line) - len(line.lstrip()) for line in lines if line.strip())
        code = "\n".join(line[indent:] for line in lines).rstrip()
        return f"```{_language(code)}\n{code}\n```"
    if kind == "table":
        rows = [line.strip().strip("|").split("|") for line in lines]
        rows = [[cell if set(cell) <= set("-: ") else escaped(cell, link) for cell in row] for row in rows]
        return "\n".join(f"|{'|'.join(row)}|" for row in rows)
    if kind == "list":
        mark = re.compile(r"(- |\d+\. )?(.*)")
        found = (mark.match(line.strip()) for line in lines)
        return "\n".join((m[1] or "  ") + escaped(m[2], link) for m in found if m)
    return "\n\n".join(_paragraph(" ".join(" ".join(lines).split()).replace("::", ":"), names, link))


def _language(code: str) -> str:
    """Whether what is indented is Python, or a formula."""
    try:
        compile(code, "docstring", "exec")
    except SyntaxError:
        return "text"
    return "python"


def _paragraph(text: str, names: set[str], link: Link) -> Iterator[str]:
    """A paragraph, and the arguments that it explains as a list."""
    starts = list(_explanations(text, names))
    before = text[: starts[0][0]] if starts else text
    if before.strip():
        yield escaped(before.strip(), link)
    ends = [*(start for start, _, _ in starts[1:]), len(text)][: len(starts)]
    items = [
        f"- {', '.join(f'`{name}`' for name in heads)}: {escaped(text[begin:end].strip().rstrip(';'), link)}"
        for (_, begin, heads), end in zip(starts, ends, strict=True)
    ]
    if items:
        yield "\n".join(items)


def _explanations(text: str, names: set[str]) -> Iterator[tuple[int, int, list[str]]]:
    """Where `name, name: ` explains arguments: its begin, that of the words, and the names."""
    for found in EXPLAINED.finditer(text):
        heads = [head.strip("`*") for head in re.split(r", | and ", found[1])]
        if set(heads) <= names:
            yield found.start(), found.end(), heads
