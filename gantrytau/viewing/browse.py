"""`browse`: results as one page in which variables are found, drawn over each other and read."""

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gantrytau.border.refusal import Given, ModelError
from gantrytau.results.display_units import Display
from gantrytau.results.result import Result
from gantrytau.viewing.animate import Shown, animate
from gantrytau.viewing.assembled import assembled
from gantrytau.viewing.film import series_of
from gantrytau.viewing.packed_runs import packed
from gantrytau.viewing.page import Page

STYLES = ("uplot/uPlot.min.css", "page.css")
SCRIPTS = (  # in the order in which they need each other; uPlot 1.6.32 is under the MIT licence, uplot/LICENSE
    "uplot/uPlot.iife.min.js",
    *(
        "data.js",
        "curves.js",
        "tree.js",
        "legend.js",
        "panels.js",
        "export.js",
        "frame.js",
        "scene.js",
        "page.js",
    ),
)


def browse(
    *results: Any,
    file: str | os.PathLike[str] | None = None,
    names: Sequence[str] = (),
    first: Sequence[str] = (),
    titles: Sequence[str] | None = None,
    display: Display = None,
    model: Shown | None = None,
    scene: bool = True,
) -> Page:
    """Results of `simulate`, or optima, as one page for any browser: variables by component, curves, cursors, bands.

    file: where the page is saved, too; names: variables and components that it holds, ("tool.r", "carts[0]"), all if none;
    first: variables that are drawn when it opens; titles: of the results, where several are shown over each other; display:
    units as of `Result.plot`; model: whose motion it is, of results that were read from a file; scene: whether the model
    is drawn beside, where it has shapes, at the time of the cursor. The page needs no network. Raises ModelError for what is
    no result, for unknown names, and for more than 400 MB of numbers.
    """
    if not results:
        raise ModelError(
            "browse: found nothing, expected results of simulate or optimize, browse(result, other)"
        )
    runs = [series_of("browse", one) for one in results]
    for run in runs:
        if not run.names:
            raise ModelError(
                f"browse: found no variables in {run.title or 'a result'}, expected some; simulate with outputs="
            )
    named = _titles(titles, [run.title or "run" for run in runs])
    kept, begun = (_names(argument, chosen) for argument, chosen in (("names", names), ("first", first)))
    title = ", ".join(dict.fromkeys(run.title for run in runs if run.title)) or "Results"
    drawn, told = _scene(results, runs, named, model) if scene else ("", None)
    blocks = packed(runs, named, kept, begun, display, told)
    made = Page(assembled(title, "page.html", blocks, drawn, STYLES, SCRIPTS), title)
    return made if file is None else replace(made, file=made.save(file))


def _scene(
    results: Sequence[Any], runs: Sequence[Result], titles: Sequence[str], model: Shown | None
) -> tuple[str, dict[str, Any] | None]:
    """The page of the motions, and its start and speed, or words why it cannot be drawn; "" and None where nothing moves."""
    moving = [k for k, run in enumerate(runs) if (model is not None or run.shapes) and np.ptp(run.time) > 0]
    if not moving:
        return "", None
    names = [titles[k] for k in moving] if len(moving) > 1 else None
    try:
        page = animate([results[k] for k in moving], names=names, model=model)
    except ModelError as error:
        if model is not None:
            raise
        return "", {"words": f"The model is not drawn: {error}"}
    return page.text, {"start": float(runs[moving[0]].time[0]), "speed": 1.0}


def _names(argument: str, names: Any) -> list[str]:
    if isinstance(names, str) or not all(isinstance(name, str) for name in names):
        words = "expected names one by one, ['x', 'tool.r']"
        raise ModelError(words, place="browse", found=Given(argument, names))
    return list(names)


def _titles(titles: Any, own: list[str]) -> list[str]:
    """The titles of runs, each once."""
    if titles is not None and (isinstance(titles, str) or len(titles) != len(own)):
        words = f"expected a list of texts, one for each of {len(own)} results"
        raise ModelError(words, place="browse", found=Given("titles", titles))
    said = own if titles is None else [str(title) for title in titles]
    return said if len(set(said)) == len(said) else [f"{title} ({k + 1})" for k, title in enumerate(said)]
