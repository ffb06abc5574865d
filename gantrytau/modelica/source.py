"""The text of a file, and messages that show the line of a fault with a caret under it."""

import os
import re
from dataclasses import dataclass
from pathlib import Path

from gantrytau.border.refusal import ModelError

WIDTH = 100  # characters of a line in a message


@dataclass(frozen=True)
class SourceText:
    """A text with the name of its file; optimica: whether it is in the dialect of `.mop` files."""

    name: str
    text: str
    optimica: bool = False

    @property
    def base(self) -> bool:
        """Whether it is in Base Modelica, as its first line says."""
        return self.text.startswith("//! base ")

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> "SourceText":
        """The text of a file in UTF-8; ModelError for a file that cannot be read or has another encoding."""
        path = Path(path)
        try:
            found = path.read_bytes()
        except OSError as error:
            raise ModelError(f"cannot be read: {error.strerror}", place=str(path)) from error
        optimica = path.suffix == ".mop"
        try:
            return cls(str(path), found.decode("utf-8-sig"), optimica)
        except UnicodeDecodeError as error:
            at = len(found[: error.start].decode("utf-8", errors="ignore"))
            wide = found[:2] in (b"\xff\xfe", b"\xfe\xff")
            name, other = ("UTF-16", "utf-16") if wide else ("Latin-1", "latin1")
            words = (
                f"found the byte 0x{found[error.start]:02x}, expected UTF-8; if the file is in {name}, convert it: "
                f"iconv -f {other} -t utf-8 {path.name}"
            )
            raise ModelError(cls(str(path), found.decode(other, errors="replace")).told(at, words)) from error

    def line_and_column(self, at: int) -> tuple[int, int]:
        """Line and column of an offset, both from 1."""
        return self.text.count("\n", 0, at) + 1, at - self.text.rfind("\n", 0, at)

    def told(self, at: int, words: str) -> str:
        """A message with file, line and column, then the line and a caret under the offset."""
        line, column = self.line_and_column(at)
        begin = at - column + 1
        written = self.text[begin:].partition("\n")[0].rstrip()
        first = max(0, column - WIDTH // 2) if len(written) > WIDTH else 0
        shown = written[first : first + WIDTH]
        pad = re.sub(r"[^\t]", " ", self.text[begin + first : at])
        return f"{self.name}, line {line}, column {column}: {words}\n    {shown}\n    {pad}^"
