"""Every notebook runs from top to bottom, and so does the code of the README."""

import ast
import re
import runpy
from pathlib import Path

import jupytext
import matplotlib
import matplotlib.pyplot as plt
import pytest

from tests.site.code_blocks import Page, blocks, run_page

matplotlib.use("Agg")

ROOT = Path(__file__).parents[2]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.py"))


@pytest.mark.filterwarnings("ignore:FigureCanvasAgg is non-interactive")
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs_and_its_assertions_hold(path, capsys):
    runpy.run_path(str(path))
    plt.close("all")
    assert len(capsys.readouterr().out.splitlines()) > 10


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_opens_as_cells_that_assert(path):
    cells = jupytext.read(path).cells
    assert {cell.cell_type for cell in cells} == {"code", "markdown"}
    assert cells[0].source.startswith("# ")
    assert sum("assert " in cell.source for cell in cells if cell.cell_type == "code") >= 3


def test_code_of_the_readme_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    page = Page((ROOT / "README.md").read_text(encoding="utf-8"))
    (code,) = [block.text for block in blocks(page.text) if block.language == "python"]
    assert len([line for line in code.splitlines() if line.strip()]) <= 30
    run_page(page, "README.md")
    assert (tmp_path / "fall.png").stat().st_size > 1000
    assert "solved" in page.printed


def drawn_and_hidden(source: str, axes: set[str]) -> list[str]:
    """Calls that draw a figure of the package in a cell, but not at its end, where notebooks show what a cell is worth."""
    hidden = []
    body = ast.parse(source).body
    for node in body:
        if isinstance(node, ast.Assign) and "subplot" in ast.unparse(node.value):
            axes |= {name.id for name in ast.walk(node.targets[0]) if isinstance(name, ast.Name)}
    for node in body[:-1]:
        call = node.value if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call) else None
        name = ast.unparse(call.func) if call else ""
        if name.rpartition(".")[2].startswith("plot") and re.split(r"\W", name)[0] not in axes:
            hidden.append(ast.unparse(node))
    return hidden


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_figures_stand_where_a_notebook_shows_them(path):
    axes = set[str]()
    cells = [cell.source for cell in jupytext.read(path).cells if cell.cell_type == "code"]
    assert [call for source in cells for call in drawn_and_hidden(source, axes)] == []


def test_a_figure_within_a_cell_is_found():
    assert drawn_and_hidden("found.plot('errors')\nprint(1)", set()) == ["found.plot('errors')"]
    assert drawn_and_hidden("figure, ax = plt.subplots()\nax.plot(x)\nprint(1)\nfound.plot()", set()) == []
