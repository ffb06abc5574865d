"""Examples with their pictures and equations. One is run again when it has changed, or anything that it could call."""

import ast
import contextlib
import io
import json
import multiprocessing
import os
import re
import tempfile
import warnings
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

from gantrytau import translate
from gantrytau.whole_files import replacing
from notebooks.site.builder.executed_notebooks import state
from notebooks.site.builder.gallery.examples import Example, examples
from notebooks.site.builder.places import DRAWN

LONGEST = 6000  # letters of equations that still help a reader
LINES, LETTERS = 2.5, 13  # points, of figures that are seen small, too
RESOLUTION = 110  # of figures, dots in an inch
MARKDOWN = (  # what stands in the LaTeX of equations, and what there is for it
    (re.compile(r"^(%.*|\\section\*.*)\n", re.MULTILINE), ""),
    (re.compile(r"\\noindent (.*?)\\par\n"), r"\1\n\n"),
    (re.compile(r"\\paragraph\{(.*?)\}(.*)"), r"**\1**\2\n"),
    (
        re.compile(r"(\\begin\{align\*\}.*?\\end\{align\*\})", re.DOTALL),
        "```{math}\n:nowrap:\n\n\\1\n```\n",
    ),
)


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
        for done in [pool.submit(_draw, examples()[name], files[name]) for name in missing]:
            done.result()
    kept = {file.stem for file in files.values()}
    for stale in (file for file in DRAWN.iterdir() if file.stem not in kept):
        stale.unlink()
    told = {name: json.loads(file.read_text()) for name, file in files.items()}
    return {
        name: Drawn(examples()[name], file.with_suffix(".png"), **told[name]) for name, file in files.items()
    }


def _draw(example: Example, file: Path) -> None:
    picture, scene, equations = run(example)
    file.with_suffix(".png").write_bytes(picture)
    with replacing(file) as partial:  # it stands only where the picture does
        partial.write_text(json.dumps({"scene": scene, "equations": equations}))


def run(example: Example) -> tuple[bytes, bool, str]:
    """The picture of an example as PNG, whether it is a scene, and its equations; RuntimeError where it fails."""
    import matplotlib as mpl
    import matplotlib.pyplot as plt

    mpl.use("Agg")
    names: dict[str, Any] = {"__name__": "__main__"}
    *first, last = ast.parse(example.code).body
    assert isinstance(last, ast.Expr), f"the last line of {example.full} shows nothing"
    style = mpl.rc_context({"lines.linewidth": LINES, "font.size": LETTERS, "legend.framealpha": 0.0})
    own_folder = contextlib.ExitStack()
    own_folder.enter_context(contextlib.chdir(own_folder.enter_context(tempfile.TemporaryDirectory())))
    with _films() as films, warnings.catch_warnings(), own_folder, style:
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
        shown.suptitle("")
        shown.savefig(file, dpi=RESOLUTION, transparent=True)
        picture = file.getvalue()
        plt.close(shown)
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
    begin, *blocks = re.split(r"^(?=\\paragraph)", text, flags=re.MULTILINE)
    own = [block for block in blocks if f"({example.name})" in block.partition("\n")[0]] or blocks
    parts = [_markdown(part) for part in (begin, *own)]
    kept: list[str] = []
    for part in parts:
        if len(part) + sum(map(len, kept)) < LONGEST:
            kept.append(part)
    if len(kept) < len(parts):
        kept.append('Others are left out: `translate(...).equations("html")` writes a page of all.')
    return "\n\n".join(kept)


def _markdown(latex: str) -> str:
    """A part of the equations in Markdown."""
    for pattern, there in MARKDOWN:
        latex = pattern.sub(there, latex)
    return latex.strip()


def shown_example(drawn: Drawn, folder: str) -> str:
    """Picture, code and equations of an example in Markdown; folder: of the pictures, from the page."""
    return f"""
```{{image}} {folder}/{drawn.example.full}.png
{picture_options(drawn)}
```

```python
{drawn.example.code}
```

```{{raw}} html
<details><summary>Equations of the example</summary>
```

{drawn.equations}

```{{raw}} html
</details>
```
"""


def picture_options(drawn: Drawn, target: str = "") -> str:
    """The options of a picture in Markdown; target: the page that it leads to."""
    options = [f":alt: {drawn.example.alt}", ":loading: lazy"]
    options += [f":class: {'scene' if drawn.scene else 'curves'}"]
    return "\n".join(options + ([f":target: {target}"] if target else []))
