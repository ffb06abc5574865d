"""Examples with their pictures and equations. One is run again when it has changed, or anything that it could call."""

import ast
import contextlib
import io
import json
import multiprocessing
import os
import re
import warnings
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

from gantrytau import translate
from notebooks.site.builder.executed_notebooks import state
from notebooks.site.builder.gallery.examples import Example, examples
from notebooks.site.builder.places import DRAWN
from notebooks.site.builder.reading.docstrings import escaped

LONGEST = 6000  # letters of equations that still help a reader
RESOLUTION = 110  # of figures, dots in an inch
BLOCK = re.compile(r"\\paragraph\{(Block \d+)\} (.*?)\n\\begin\{align\*\}\n(.*?)\\end\{align\*\}", re.DOTALL)


@dataclass(frozen=True)
class Drawn:
    """An example that was run. picture: file of the PNG; scene: whether it shows bodies; equations: in Markdown."""

    example: Example
    picture: Path
    scene: bool
    equations: str


def drawn_examples(workers: int | None = None) -> dict[str, Drawn]:
    """All of them by the full names of their components; RuntimeError with the example that fails."""
    DRAWN.mkdir(parents=True, exist_ok=True)
    how = b"".join(file.read_bytes() for file in sorted(Path(__file__).parent.glob("*.py")))
    files = {
        name: DRAWN / f"{name}-{state(one.code.encode() + how)}.json" for name, one in examples().items()
    }
    missing = [name for name, file in files.items() if not file.exists()]
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers or len(os.sched_getaffinity(0)), mp_context=context) as pool:
        waiting = {name: pool.submit(run, examples()[name]) for name in missing}
        for name, done in waiting.items():
            picture, scene, equations = done.result()
            files[name].with_suffix(".png").write_bytes(picture)
            files[name].write_text(json.dumps({"scene": scene, "equations": equations}))
    kept = {file.stem for file in files.values()}
    for stale in (file for file in DRAWN.iterdir() if file.stem not in kept):
        stale.unlink()
    told = {name: json.loads(file.read_text()) for name, file in files.items()}
    return {
        name: Drawn(examples()[name], file.with_suffix(".png"), **told[name]) for name, file in files.items()
    }


def run(example: Example) -> tuple[bytes, bool, str]:
    """The picture of an example as PNG, whether it is a scene, and its equations; RuntimeError where it fails."""
    import matplotlib as mpl

    mpl.use("Agg")
    names: dict[str, Any] = {"__name__": "__main__"}
    *first, last = ast.parse(example.code).body
    assert isinstance(last, ast.Expr), f"the last line of {example.full} shows nothing"
    with _films() as films, warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        try:
            exec(compile(ast.Module(first, []), example.full, "exec"), names)
            shown = eval(compile(ast.Expression(last.value), example.full, "eval"), names)
        except Exception as error:
            raise RuntimeError(f"the example of {example.full} fails: {error}\n\n{example.code}") from error
    if films:
        from notebooks.site.builder.gallery.scene_picture import scene_picture

        picture = scene_picture(films[-1])
    else:
        file = io.BytesIO()
        shown.savefig(file, dpi=RESOLUTION, transparent=True)
        picture = file.getvalue()
    return picture, bool(films), _equations(names, example)


@contextlib.contextmanager
def _films() -> Iterator[list[Any]]:
    """What `view` and `animate` would show, in place of pages."""
    found: list[Any] = []
    with patch("gantrytau.viewing.page.page", lambda films, names, title: found.extend(films) or ""):
        yield found


def _equations(names: dict[str, Any], example: Example) -> str:
    """The equations of the model of an example, those in which the component has a part, in Markdown."""
    model = names.get("model") or names["Example"]()
    text = translate(model, events=True).equations("latex")
    blocks = [found.groups() for found in BLOCK.finditer(text)]
    blocks = [one for one in blocks if f"({example.name})" in one[1]] or blocks
    parts = [
        f"{number}, {escaped(words)}\n\n```{{math}}\n:nowrap:\n\n\\begin{{align*}}\n{lines}\\end{{align*}}\n```"
        for number, words, lines in blocks
    ]
    kept = ""
    for part in parts:
        if len(kept) + len(part) > LONGEST:
            return f'{kept}Of {len(parts)} blocks; `translate(...).equations("html")` writes a page of all.'
        kept += f"{part}\n\n"
    return kept
