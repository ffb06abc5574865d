"""A page put together from the files of `results_page`, data, and the page of a film in a frame."""

import html
import json
from collections.abc import Iterable
from pathlib import Path

FOLDER = Path(__file__).parent / "results_page"


def assembled(
    title: str, body: str, blocks: Iterable[str], scene: str, styles: Iterable[str], scripts: Iterable[str]
) -> str:
    """The HTML of a page. body: the file of its elements, in which {title} stands; blocks: data for its scripts; scene:
    HTML of the frame; scripts: in the order in which they need each other.
    """
    frame = json.dumps(scene).replace("<", "\\u003c")  # nothing in it ends the script
    return "\n".join(
        [
            '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{html.escape(title)}</title>",
            *(f"<style>{_text(name)}</style>" for name in styles),
            f"</head><body>{_text(body).replace('{title}', html.escape(title))}",
            '<script type="text/plain" id="data">',
            *blocks,
            "</script>",
            f'<script type="application/json" id="scene-page">{frame}</script>',
            *(f"<script>{_text(name)}</script>" for name in scripts),
            "</body></html>\n",
        ]
    )


def _text(name: str) -> str:
    return (FOLDER / name).read_text(encoding="utf-8")
