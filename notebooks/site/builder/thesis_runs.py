"""Calls of the pages of the thesis, executed again when they have changed, or anything that they could call."""

import ast
import json
import math
import sys
import time
import tomllib
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from notebooks.site.builder.executed_notebooks import state
from notebooks.site.builder.places import EXECUTED, SOURCES

FOLDER = EXECUTED / "thesis"
DPI = 80
DRAWING = "a photo or a drawing, without data"
BEGIN = "import math\nfrom dataclasses import replace\n\nimport numpy as np\n"
PARTS = (
    "numbers",
    "subject",
    "uses",
    "call",
    "names",
    "page",
    "why",
    "said",
    "small",
    "scene",
    "printed",
)  # of a row


@dataclass(frozen=True)
class Printed:
    """A number of the thesis beside ours: a number or the two ends of a range, an expression, its unit, where ours is from.

    origin: "found" by the toolkit, "given" to it, "assumed" where the thesis has none, or "fitted" to the printed number.
    within: the largest difference in percent of the printed number.
    """

    what: str
    thesis: float | Sequence[float]
    here: str
    unit: str = "1"
    origin: str = "found"
    within: float = 10.0

    def off(self, value: float) -> float:
        """How far a value is from the printed number or range, relative to the number or the nearer end."""
        low, high = self.thesis if isinstance(self.thesis, Sequence) else (self.thesis, self.thesis)
        nearest = min(max(value, low), high)
        return (value - nearest) / abs(nearest) if nearest else value


@dataclass(frozen=True, eq=False)
class Item:
    """A figure or a table: number, subject, code before the call, the call, names in it, a page, or why there is none.

    scene: a picture of a camera, which stays as it is on dark pages.
    """

    kind: str
    number: str
    subject: str
    uses: Sequence[str] = ()
    call: str = ""
    names: Sequence[str] = ()
    page: str = ""
    why: str = ""
    said: str = ""
    small: str = ""
    scene: bool = False
    printed: Sequence[Printed] = ()

    @property
    def chapter(self) -> str:
        """The chapter, or A for the appendix."""
        return self.number.partition(".")[0]


@dataclass(frozen=True)
class Made:
    """What a call gave: pictures on file, text of what is no picture, our number for each printed one, duration in s."""

    pictures: Sequence[Path] = ()
    text: str = ""
    values: Sequence[float] = ()
    seconds: float = field(default=0.0, compare=False)


@cache
def _rows() -> dict[str, Any]:
    """Figures, tables and code before calls, of all chapters."""
    found: dict[str, Any] = {"setup": {}, "figure": [], "table": []}
    for path in sorted((SOURCES / "thesis_runs").glob("*.toml")):
        text = tomllib.loads(path.read_text(encoding="utf-8"))
        for kind in ("figure", "table"):
            found[kind] += text.get(kind, [])
        if twice := found["setup"].keys() & text.get("setup", {}).keys():
            raise ValueError(f"{path}: found setup {twice} again, expected a new name")
        found["setup"] |= text.get("setup", {})
    return found


@cache
def items() -> tuple[Item, ...]:
    """All figures and tables, by kind and number."""
    found: list[Item] = []
    for kind in ("figure", "table"):
        for row in _rows()[kind]:
            if unknown := row.keys() - set(PARTS):
                raise ValueError(f"{kind} {row['numbers']}: found {unknown}, expected {', '.join(PARTS)}")
            rest = {key: row[key] for key in row if key not in ("numbers", "printed")}
            printed = tuple(Printed(**one) for one in row.get("printed", ()))
            found += [Item(kind, number, printed=printed, **rest) for number in row["numbers"]]
    return tuple(sorted(found, key=lambda one: (one.kind, one.chapter, int(one.number.partition(".")[2]))))


def code_before(item: Item) -> dict[str, str]:
    """Code that a call needs before it, by name and in order."""
    found: dict[str, str] = {}

    def add(names: Sequence[str]) -> None:
        for name in names:
            row = _rows()["setup"][name]
            add(row.get("uses", ()))
            found.setdefault(name, row["code"])

    add(item.uses)
    return found


class Session:
    """Runs calls one after the other. Code that several of them need runs once."""

    def __init__(self) -> None:
        self._ran: dict[tuple[str, ...], dict[str, Any]] = {}

    def run(self, item: Item) -> tuple[Any, list[float]]:
        """What the call gives, and our number for each printed one."""
        names = self._after(tuple(code_before(item).items()))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            answer = _executed(item.call, names := dict(names), f"{item.kind} {item.number}")
            names["answer"] = answer
            return answer, [float(eval(one.here, names)) for one in item.printed]

    def _after(self, code: tuple[tuple[str, str], ...]) -> dict[str, Any]:
        key = tuple(name for name, _ in code)
        if key not in self._ran:
            if not code:
                names: dict[str, Any] = {}
                exec(BEGIN, names)
            else:
                names = dict(self._after(code[:-1]))
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    _executed(code[-1][1], names, key[-1])
            self._ran[key] = names
        return self._ran[key]


def _executed(code: str, names: dict[str, Any], title: str) -> Any:
    """The value of the last expression."""
    tree = ast.parse(code.strip(), title)
    last = tree.body[-1]
    if not isinstance(last, ast.Expr):
        exec(compile(tree, title, "exec"), names)
        return None
    tree.body.pop()
    exec(compile(tree, title, "exec"), names)
    return eval(compile(ast.Expression(last.value), title, "eval"), names)


def made() -> Iterator[tuple[Item, Made]]:
    """Each item with a call, and what it gave; RuntimeError with the item that fails."""
    session, kept = Session(), set[Path]()
    FOLDER.mkdir(parents=True, exist_ok=True)
    for item in items():
        if item.call:
            stem = FOLDER / f"{item.kind}-{item.number}-{_state(item)}"
            if not stem.with_name(stem.name + ".json").exists():
                _keep(item, session, stem)
            one = _kept(stem)
            kept |= {stem.with_name(stem.name + ".json"), *one.pictures}
            yield item, one
    for path in set(FOLDER.iterdir()) - kept:
        path.unlink()


def _keep(item: Item, session: Session, stem: Path) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    begin = time.process_time()
    try:
        answer, values = session.run(item)
    except Exception as error:
        raise RuntimeError(f"{item.kind} {item.number}: the call fails with {error!r}") from error
    if off := differences(item, values):
        raise RuntimeError("\n".join(off))
    figures = list(answer) if isinstance(answer, list | tuple) else [answer]
    drawn = all(hasattr(figure, "savefig") for figure in figures)
    for k, figure in enumerate(figures if drawn else []):
        figure.savefig(stem.with_name(f"{stem.name}-{k}.png"), dpi=DPI)
    pyplot.close("all")
    told: dict[str, Any] = dict(
        pictures=len(figures) if drawn else 0, text="" if drawn else str(answer), values=values
    )
    told["seconds"] = time.process_time() - begin
    stem.with_name(stem.name + ".json").write_text(json.dumps(told), encoding="utf-8")
    print(f"  {item.kind} {item.number}: {told['seconds']:.1f} s", file=sys.stderr, flush=True)


def _kept(stem: Path) -> Made:
    told = json.loads(stem.with_name(stem.name + ".json").read_text(encoding="utf-8"))
    pictures = [stem.with_name(f"{stem.name}-{k}.png") for k in range(told["pictures"])]
    return Made(pictures, told["text"], told["values"], told["seconds"])


def _state(item: Item) -> str:
    code = "\0".join([BEGIN, *code_before(item).values(), item.call, *(one.here for one in item.printed)])
    return state(code.encode() + Path(__file__).read_bytes())


def differences(item: Item, values: Sequence[float]) -> list[str]:
    """Printed numbers that ours differ from by more than is told of them."""
    return [
        f"{item.kind} {item.number}, {one.what}: found {value:.4g}, expected {one.thesis} {one.unit} within {one.within} %"
        for one, value in zip(item.printed, values, strict=True)
        if not math.isfinite(value) or abs(100 * one.off(value)) > one.within
    ]
