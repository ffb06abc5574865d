"""`browse`: results as one page in which variables are found, drawn over each other and read."""

import html
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from gantrytau.border.refusal import Given, ModelError
from gantrytau.results.display_units import Display
from gantrytau.viewing.film import series_of
from gantrytau.viewing.packed_runs import packed
from gantrytau.viewing.page import Page

FOLDER = Path(__file__).parent / "results_page"
STYLES = ("uplot/uPlot.min.css", "page.css")
SCRIPTS = (  # in the order in which they need each other; uPlot 1.6.32 is under the MIT licence, uplot/LICENSE
    "uplot/uPlot.iife.min.js",
    *("data.js", "curves.js", "tree.js", "legend.js", "panels.js", "export.js", "scene.js", "page.js"),
)


def browse(
    *results: Any,
    file: str | os.PathLike[str] | None = None,
    names: Sequence[str] = (),
    first: Sequence[str] = (),
    titles: Sequence[str] | None = None,
    display: Display = None,
) -> Page:
    """Results of `simulate`, or optima, as one page for any browser: variables by component, curves, cursors, bands.

    file: where the page is saved, too; names: variables and components that it holds, ("tool.r", "carts[0]"), all if none;
    first: variables that are drawn when it opens; titles: of the results, where several are shown over each other; display:
    units as of `Result.plot`. The page needs no network. Raises ModelError for what is no result, for unknown names, and for
    more than 400 MB of numbers.
    """
    if not results:
        raise ModelError(
            "browse: found nothing, expected results of simulate or optimize, browse(result, other)"
        )
    runs = [series_of("browse", one) for one in results]
    named = _titles(titles, [run.title or "run" for run in runs])
    kept, begun = (_names(argument, chosen) for argument, chosen in (("names", names), ("first", first)))
    title = ", ".join(dict.fromkeys(run.title for run in runs if run.title)) or "Results"
    made = Page(_text(title, packed(runs, named, kept, begun, display)), title)
    return made if file is None else replace(made, file=made.save(file))


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


def _text(title: str, blocks: Sequence[str]) -> str:
    """The HTML of the page."""
    read = {name: (FOLDER / name).read_text(encoding="utf-8") for name in (*STYLES, *SCRIPTS, "page.html")}
    body = read["page.html"].replace("{title}", html.escape(title))
    return "\n".join(
        [
            '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{html.escape(title)}</title>",
            *(f"<style>{read[name]}</style>" for name in STYLES),
            f'</head><body>{body}<script type="text/plain" id="data">',
            *blocks,
            "</script>",
            *(f"<script>{read[name]}</script>" for name in SCRIPTS),
            "</body></html>\n",
        ]
    )
