"""Pages of Markdown, run as they stand: their Python, their commands, and what they say that these print.

| block | what is done with it |
|---|---|
| ```python | runs, one after the other, in the names of the page; it is saved as `cart.py` if it begins with `# cart.py` |
| ```toml, ```csv, ```modelica | saved, if it begins with `# cell.toml` or `// cart.mo` |
| ```console | commands behind `$ ` run; what they print stands below them |
| ```text behind a python block | what that prints; or the error that it ends with, `ModelError: ...` |

What is printed is compared word by word. White space does not count; a number with a point may differ by one in its last
place, or by a thousandth; `...` stands for any words. A picture that a page shows from `pictures/` is one that its code
makes, of the same name and size. A page runs in a folder of its own.

`python -m tests.site.code_blocks PAGE ...` writes into pages what is printed, where they say something else, and pictures.
"""

import contextlib
import io
import linecache
import os
import re
import shlex
import shutil
import sys
import tempfile
import textwrap
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import matplotlib as mpl

BLOCK = re.compile(r"^```(\w+)[^\n]*\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SAVED = re.compile(r"(?:#|//) ([\w./-]+\.(?:py|toml|csv|mop?))\n")
BEHIND = re.compile(r"```\s*```text[^\n]*\n")
COMMANDS = re.compile(r"^\$ (.*)\n((?:(?!\$ ).*\n)*)", re.MULTILINE)
ERROR = re.compile(r"^(?:\w+\.)*(\w+(?:Error|Exception)):\s", re.MULTILINE)
NUMBER = re.compile(r"(?<![\w.])([-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?)(?!\w)")
PICTURE = re.compile(r"(?:!\[[^\]]*\]\(|```\{(?:image|figure)\} )([\w./-]*pictures/[\w.-]+)")
NOTHING = 1e-9  # numbers below it are rounding
PAGE_WIDTH, WIDTH = 110, "100"  # of what is written into a page, and of the terminal


class PageError(AssertionError):
    """A page does not hold what it says."""


@dataclass(frozen=True)
class Block:
    """A block of code: its language, its text and where that stands in the page, and its first line."""

    language: str
    text: str
    begin: int
    end: int
    line: int


@dataclass
class Page:
    """What came of a page: its names, what is printed otherwise than it shows, what else does not hold, all output."""

    text: str
    names: dict[str, Any] = field(default_factory=lambda: {"__name__": "__main__"})
    changes: list[tuple[int, int, str]] = field(default_factory=list)
    unlike: list[str] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    printed: str = ""

    def expect(self, shown: str, printed: str, begin: int, line: int) -> None:
        """Compare what stands from `begin` on, of a block in `line`, with what was printed."""
        if not same(shown, printed):
            self.unlike.append(f"line {line}: the page shows\n{shown}\nand this is printed:\n{printed}")
            self.changes.append((begin, begin + len(shown), wrapped(printed)))

    @property
    def mended(self) -> str:
        """The page with what was printed."""
        text = self.text
        for begin, end, printed in sorted(self.changes, reverse=True):
            text = text[:begin] + printed + text[end:]
        return text


def blocks(text: str) -> list[Block]:
    """The blocks of code of a page; those of the site itself, as {image}, are none."""
    return [
        Block(found[1], found[2], found.start(2), found.end(2), text.count("\n", 0, found.start()) + 1)
        for found in BLOCK.finditer(text)
    ]


def wrapped(printed: str) -> str:
    """What is printed, with long lines broken between words, as it is written into a page."""
    lines = [line.rstrip() for line in printed.rstrip().splitlines()]
    broken = [
        textwrap.fill(
            line, PAGE_WIDTH, break_long_words=False, break_on_hyphens=False, subsequent_indent="    "
        )
        if len(line) > PAGE_WIDTH
        else line
        for line in lines
    ]
    return "".join(f"{line}\n" for line in broken)


def same(shown: str, printed: str) -> bool:
    """Whether what a page shows is what is printed."""
    wanted, words = shown.split(), printed.split()
    here, there, gap, behind = 0, 0, -1, 0
    while there < len(words):  # "..." takes words one by one until the rest fits
        if here < len(wanted) and wanted[here] == "...":
            gap, behind = here, there
            here += 1
        elif here < len(wanted) and same_word(wanted[here], words[there]):
            here, there = here + 1, there + 1
        elif gap >= 0:
            behind += 1
            here, there = gap + 1, behind
        else:
            return False
    return all(word == "..." for word in wanted[here:])


def same_word(shown: str, printed: str) -> bool:
    """The same letters, and numbers that are near; `...` within a word stands for any letters."""
    if "..." in shown:
        return re.fullmatch(".*".join(map(re.escape, shown.split("..."))), printed) is not None
    pairs = NUMBER.split(shown), NUMBER.split(printed)
    if len(pairs[0]) != len(pairs[1]):
        return False
    return all(
        near(*pair) if k % 2 else pair[0] == pair[1] for k, pair in enumerate(zip(*pairs, strict=True))
    )


def near(shown: str, printed: str) -> bool:
    """Whether two numbers are the same to the last place that is shown, or to a thousandth."""
    if shown == printed:
        return True
    if not re.search(r"[.eE]", shown):
        return False
    digits, _, power = shown.lower().partition("e")
    if decimals(shown) > decimals(printed) + 2:  # as of one that is printed rounded
        return False
    place = 10.0 ** (int(power or 0) - len(digits.partition(".")[2]))
    a, b = float(shown), float(printed)
    return abs(a - b) <= max(1.001 * place, 1e-3 * abs(a)) or max(abs(a), abs(b)) < NOTHING


def decimals(number: str) -> int:
    """How many places stand behind the point."""
    return len(number.lower().partition("e")[0].partition(".")[2])


def run_page(page: Page, title: str) -> None:
    """Run a page in the current folder. Raises PageError where it cannot go on."""
    text, found = page.text, blocks(page.text)
    for block, after in zip(found, [*found[1:], None], strict=True):
        if saved := SAVED.match(block.text):
            file = Path(saved[1])
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(block.text, encoding="utf-8")
        if block.language == "python":
            behind = after is not None and BEHIND.fullmatch(text, block.end, after.begin)
            _run_python(page, block, after if behind else None, title)
        elif block.language == "console":
            for command in COMMANDS.finditer(block.text):
                _run_command(page, block, command)


def _run_python(page: Page, block: Block, shown: Block | None, title: str) -> None:
    out, place = io.StringIO(), f"{title}, block in line {block.line}"
    linecache.cache[place] = (len(block.text), None, block.text.splitlines(keepends=True), place)
    try:
        with contextlib.redirect_stdout(out):
            exec(compile(block.text, place, "exec"), page.names)
    except Exception as error:
        if shown is None or not ERROR.search(shown.text):
            raise PageError(f"{place}: {type(error).__name__}: {error}") from error
        out.write(f"{type(error).__name__}: {error}")
    finally:
        _close_figures()
        page.printed += out.getvalue()
    if shown is not None:
        page.expect(shown.text, out.getvalue(), shown.begin, shown.line)


def _run_command(page: Page, block: Block, found: re.Match[str]) -> None:
    """Run the commands of a line, with `&&` and `>`, in this process."""
    said, line = "", block.line + 1 + block.text.count("\n", 0, found.start())
    for part in found[1].partition("  #")[0].split(" && "):
        words = shlex.split(part)
        target = words[words.index(">") + 1] if ">" in words else None
        words = words[: words.index(">")] if target else words
        code, printed, notes = _call(words, line)
        if target:
            Path(target).write_text(printed, encoding="utf-8")
            printed = ""
        said += printed + notes
        if code:
            if not found[2].strip():
                page.faults.append(f"line {line}: {part} ends with exit code {code}:\n{said}")
            break
    page.expect(found[2], said, block.begin + found.start(2), line)


def _call(words: Sequence[str], line: int) -> tuple[int, str, str]:
    """Exit code, output and messages of one command."""
    from typer.testing import CliRunner

    from gantrytau.commands.app import app

    if words[0] == "cd":
        os.chdir(words[1])
        return 0, "", ""
    if words[0] == "cat":
        return 0, Path(words[1]).read_text(encoding="utf-8"), ""
    if words[0] == "python":
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            exec(
                compile(Path(words[1]).read_text(encoding="utf-8"), words[1], "exec"),
                {"__name__": "__main__"},
            )
        return 0, out.getvalue(), ""
    if words[0] != "gantrytau":
        raise PageError(f"line {line}: found the command {words[0]}, expected gantrytau, python, cat or cd")
    answer = CliRunner().invoke(app, list(words[1:]), env={"COLUMNS": WIDTH, "NO_COLOR": "1"})
    _close_figures()
    if answer.exception is not None and not isinstance(answer.exception, SystemExit):
        raise PageError(f"line {line}: {shlex.join(words)}") from answer.exception
    return answer.exit_code, answer.stdout, answer.stderr


def _close_figures() -> None:
    if pyplot := sys.modules.get("matplotlib.pyplot"):
        pyplot.close("all")


def pictures(text: str) -> list[str]:
    """The pictures that a page shows of what its code makes, as they stand in it."""
    return PICTURE.findall(text)


def size_of(picture: Path) -> tuple[int, ...]:
    """Rows and columns of a picture."""
    from matplotlib.image import imread

    return imread(picture).shape[:2]


@contextlib.contextmanager
def own_folder() -> Iterator[Path]:
    """A folder that is the current one, and is gone afterwards; figures are not shown."""
    before = Path.cwd()
    mpl.use("Agg")
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.filterwarnings("ignore", "FigureCanvasAgg is non-interactive")
        sys.path.insert(0, "")  # the current folder, as at a prompt
        os.chdir(folder)
        try:
            yield Path(folder)
        finally:
            os.chdir(before)
            sys.path.remove("")
            for name in [name for name, module in sys.modules.items() if _is_in(module, folder)]:
                del sys.modules[name]


def _is_in(module: Any, folder: str) -> bool:
    return str(getattr(module, "__file__", None) or "").startswith(folder)


def check_page(file: Path, *, write: bool = False) -> Page:
    """Run a page in a folder of its own and raise PageError with all that does not hold, or write what it prints into it."""
    file = file.resolve()
    page = Page(file.read_text(encoding="utf-8"))
    with own_folder() as folder:
        try:
            run_page(page, file.name)
        except PageError as error:
            page.faults.append(f"{error}")
            page.faults += [] if error.__cause__ is None else [repr(error.__cause__)]
        for picture in pictures(page.text):
            made, kept = folder / Path(picture).name, file.parent / picture
            if not made.is_file():
                page.faults.append(f"no code of the page makes {made.name}, which it shows")
            elif write:
                kept.parent.mkdir(exist_ok=True)
                shutil.copy(made, kept)
            elif not kept.is_file() or size_of(kept) != size_of(made):
                page.faults.append(f"{picture} is not there, or not of the size of what the code makes")
    if write:
        file.write_text(page.mended, encoding="utf-8")
    elif page.faults or page.unlike:
        remedy = f"\n`python -m tests.site.code_blocks {file}` writes what is printed into the page; then read it again"
        raise PageError(f"{file}: " + "\n".join(page.unlike + page.faults) + remedy)
    return page


if __name__ == "__main__":
    for name in sys.argv[1:]:
        came = check_page(Path(name), write=True)
        print(f"{name}: {len(came.changes)} blocks written", *came.faults, sep="\n")
