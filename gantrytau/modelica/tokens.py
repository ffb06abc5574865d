"""The tokens of a text, and a cursor over them that collects faults."""

import re
from collections.abc import Callable
from typing import NoReturn, TypeVar

from gantrytau.border.refusal import ModelError
from gantrytau.modelica.base_modelica import decoded
from gantrytau.modelica.source import SourceText

KEYWORDS = frozenset(
    re.findall(
        r"\w+",
        "algorithm and annotation block break class connect connector constant constrainedby der discrete each else elseif "
        "elsewhen encapsulated end enumeration equation expandable extends external false final flow for function if import "
        "impure in initial inner input loop model not operator or outer output package parameter partial protected public "
        "pure record redeclare replaceable return stream then true type when while within",
    )
)
OPTIMICA = frozenset({"optimization", "constraint"})
TOKEN = re.compile(
    r"""(?P<skip>(?:\s+|//[^\n]*|/\*(?s:.*?)\*/)+)
    |(?P<name>[A-Za-z_][A-Za-z0-9_]*|'(?:[^'\\\n]|\\.)+')
    |(?P<number>(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)  # .5 is not in the grammar, but in files
    |"(?P<string>[^"\\]*(?:\\(?s:.)[^"\\]*)*)"
    |(?P<open>/\*|["'])
    |(?P<sign>\.[*/^+-]|:=|<=|>=|<>|==|[-+*/^=<>()\[\]{},;:.])
    |(?P<other>(?s:.))""",
    re.VERBOSE,
)
DECORATED = re.compile(
    TOKEN.pattern.replace("(?:", "(?:@[0-9]+|", 1), re.VERBOSE
)  # of Base Modelica, where @1 says nothing
PLAIN_NAME = re.compile(r"\.?[A-Za-z_]\w*|'.*'", re.ASCII)
UNCLOSED = {
    "/*": "found a comment that no '*/' closes",
    '"': "found a string that no quote closes",
    "'": "found a name in quotes that is not closed in its line",
}
SECTIONS = frozenset({"public", "protected", "equation", "algorithm", "constraint", "external"})
BLOCKS = frozenset({"if", "for", "when", "while"})
MOST = 20  # messages of a file
Item = TypeVar("Item")


def spelled(name: str) -> str:
    """A name as it stands in a text: in quotes if it is no identifier, as decoded ones of Base Modelica may be."""
    if not name or (PLAIN_NAME.fullmatch(name) and name not in KEYWORDS - {"der", "initial", "pure"}):
        return name
    return "'" + re.sub(r"(['\\])", r"\\\1", name) + "'"


class Faulty(Exception):
    """A fault that is noted; whoever reads a list goes on behind it."""


class Tokens:
    """A cursor over the tokens of a text. The kind of a token is its text; "name", "number", "string", "" at the end.

    A fault is noted and raises `Faulty`; `recover` goes on behind it, so that each fault has one message.
    """

    def __init__(self, source: SourceText):
        self.source = source
        self.faults: list[tuple[int, str]] = []
        self.unclosed: tuple[int, str] | None = None
        self.kinds: list[str] = []
        self.texts: list[str] = []
        self.starts: list[int] = []
        self._split()
        self.i = 0
        self.kind = self.kinds[0]
        self.subscripts = 0  # how many subscripts are open: `end` is a value there

    def _split(self) -> None:
        kinds, texts, starts = self.kinds, self.texts, self.starts
        keywords = KEYWORDS | OPTIMICA if self.source.optimica else KEYWORDS
        base = self.source.base
        pattern = DECORATED if base else TOKEN
        for found in pattern.finditer(self.source.text):
            kind = found.lastgroup
            if kind == "skip":
                continue
            text = found[kind] if kind else ""
            if kind == "sign" or (kind == "name" and text in keywords):
                kind = text
            elif base and kind == "name" and text[0] == "'":
                text = decoded(text)
            elif kind == "open":
                self.unclosed = found.start(), text
                break
            kinds.append(kind or "")
            texts.append(text)
            starts.append(found.start())
        kinds.append("")
        texts.append("")
        starts.append(len(self.source.text.rstrip()) if self.unclosed is None else self.unclosed[0])

    @property
    def at(self) -> int:
        """The offset of the present token."""
        return self.starts[self.i]

    @property
    def next_kind(self) -> str:
        """The kind of the token behind the present one."""
        return self.kinds[min(self.i + 1, len(self.kinds) - 1)]

    def advance(self) -> str:
        """The text of the present token, which is passed."""
        text = self.texts[self.i]
        if self.kind:
            self.i += 1
            self.kind = self.kinds[self.i]
        return text

    def take(self, kind: str) -> bool:
        """Whether the present token is of this kind; if so it is passed."""
        if self.kind != kind:
            return False
        self.advance()
        return True

    def expect(self, kind: str, told: str = "") -> str:
        """The text of the present token, which must be of this kind, and is passed; told: what a message expects."""
        if self.kind != kind:
            self.refuse(told or {"name": "a name", "string": "a string"}.get(kind, f"'{kind}'"))
        return self.advance()

    def listed(self, read: Callable[[], Item], separator: str = ",") -> tuple[Item, ...]:
        """One item or more with separators between them."""
        found = [read()]
        while self.take(separator):
            found.append(read())
        return tuple(found)

    def note(self, at: int, words: str) -> None:
        """A fault from which reading goes on at once; the first at its place tells it."""
        if all(at != noted for noted, _ in self.faults):
            self.faults.append((at, words))

    def refuse(self, expected: str) -> NoReturn:
        """The present token is not what is expected."""
        i, text = self.i, self.texts[self.i]
        at = self.at
        if self.unclosed is not None and not self.kind:  # which is told instead
            raise Faulty
        found = {"": "the end of the file", "string": "a string", "number": text, "other": repr(text)}.get(
            self.kind, f"'{text}'"
        )
        if self.kind == "end" and self.texts[i + 1].isidentifier():
            found = f"'end {self.texts[i + 1]}'"
        elif self.kind == text and text.isalpha():
            found = f"the keyword {found}"
        elif text in OPTIMICA:
            expected += f"; '{text}' is Optimica, which stands in .mop files"
        before = self.starts[i - 1] if i else 0
        if i and self.kinds[i - 1] == "string" and "\n" in self.texts[i - 1]:
            line = self.source.line_and_column(before)[0]
            expected += f"; the string before it begins in line {line}: is a quote missing?"
        elif i and expected == "';'" and "\n" in self.source.text[before:at]:
            # it is missing behind the token before
            line = self.source.line_and_column(at)[0]
            length = len(self.texts[i - 1]) + 2 * (self.kinds[i - 1] == "string")
            at, found = before + length, f"{found} in line {line}"
        self.note(at, f"found {found}, expected {expected}")
        raise Faulty

    def close(self) -> None:
        """The `;` behind an item. Where it is missing at the end of a line, reading goes on in the next one."""
        if self.kind == ";":
            self.advance()
            return
        lacking = self.i > 0 and "\n" in self.source.text[self.starts[self.i - 1] : self.at]
        try:
            self.refuse("';'")
        except Faulty:
            if not lacking or self.kinds[self.i - 1] == "string":
                raise

    def section_begins(self) -> bool:
        """Whether a section of a class begins here; `initial` does so before `equation` and `algorithm` only."""
        return self.kind in SECTIONS or (
            self.kind == "initial" and self.next_kind in ("equation", "algorithm")
        )

    def recover(self, start: int) -> None:
        """Go on behind the item that begins with token `start`: behind its `;`, or its `end`, or before a section."""
        self.subscripts = 0
        kinds = self.kinds
        block = kinds[start] in BLOCKS
        brackets = 0 if block else kinds[start : self.i].count("[") - kinds[start : self.i].count("]")
        depth = self._open_blocks(start) if block else 0
        while self.kind and not self.section_begins():
            if self.kind == "end" and (self.next_kind in ("name", *BLOCKS) or kinds[self.i - 1] == ";"):
                if not depth or self.next_kind not in BLOCKS:
                    return
                depth -= 1
                self.advance()
            elif self.kind in BLOCKS and kinds[self.i - 1] in (";", "loop") and depth:
                depth += 1
            elif self.kind in ("[", "]"):
                brackets += 1 if self.kind == "[" else -1
            elif self.kind == ";" and depth == 0 and brackets <= 0:
                self.advance()
                return
            self.advance()

    def _open_blocks(self, start: int) -> int:
        """Number of blocks that began since token `start` and are still open at the fault."""
        depth = 1
        for i in range(start + 1, self.i):
            if self.kinds[i] in BLOCKS:
                depth += {"end": -1, ";": 1, "loop": 1}.get(self.kinds[i - 1], 0)
        return depth

    def raise_faults(self) -> None:
        """ModelError with all faults, in the order of the text."""
        faults = sorted(self.faults)
        if self.unclosed is not None:
            at, opening = self.unclosed
            faults.append((at, UNCLOSED[opening]))
            if opening == '"':  # behind a quote that is missing, text and strings are interchanged
                faults = faults[:1]
        if not faults:
            return
        messages = [self.source.told(at, words) for at, words in faults[:MOST]]
        if len(faults) > MOST:
            messages.append(f"{self.source.name}: and {len(faults) - MOST} more")
        raise ModelError("\n".join(messages))
