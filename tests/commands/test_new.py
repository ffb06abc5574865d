"""`gantrytau new robot`: the project is written, its commands and tests run, its notebook too; nothing is overwritten."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

MISUSE = 2
FILES = {"README.md", "robot.py", "move.py", "test_robot.py", "notebook.py"}
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A project that was written, by a program as users call it."""
    folder = tmp_path_factory.mktemp("new") / "my_first-robot"
    found = _python(folder.parent, "-m", "gantrytau.cli", "new", "robot", folder.name)
    assert found.returncode == 0, found.stderr
    (named,) = re.findall(rf"cd {folder.name} && gantrytau (check .*);", found.stdout)
    checked = _python(folder, "-m", "gantrytau.cli", *named.split())
    assert checked.stdout.startswith("FiveBar: "), checked.stderr
    return folder


def _python(folder, *arguments):
    environment = {**os.environ, "MPLBACKEND": "agg", "PYTHONPATH": os.pathsep.join(_paths())}
    return subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


def _paths():
    return [str(ROOT), *(str(ROOT / name) for name in ("models", "optimica", "fmu"))]


def test_the_files_are_there_and_bear_the_name_of_the_folder(project):
    assert {path.name for path in project.iterdir() if path.is_file()} == FILES
    assert (project / "README.md").read_text().startswith("# my first robot\n")
    for file in project.iterdir():
        assert "MY_ROBOT" not in file.read_text()


def test_its_own_tests_pass(project):
    found = _python(project, "-m", "pytest", "-q", "-p", "no:cacheprovider")
    assert found.returncode == 0, found.stdout
    assert "5 passed" in found.stdout


def test_its_notebook_runs(project):
    found = _python(project, "notebook.py")
    assert found.returncode == 0, found.stderr
    duration = re.search(r"final_time = ([\d.]+) s", found.stdout)
    assert duration is not None
    # s, as on ever finer meshes, to what is asked for
    assert float(duration[1]) == pytest.approx(0.28547, rel=1e-3)
    jupytext = pytest.importorskip("jupytext")
    cells = jupytext.read(project / "notebook.py").cells
    assert {cell.cell_type for cell in cells} == {"markdown", "code"}


PAGE = (ROOT / "gantrytau/commands/new/five_bar/README.md.txt").read_text().splitlines()
# the notebook refines the motion, too
COMMANDS = [line for line in PAGE if line.startswith("gantrytau ") and "--refine" not in line]


@pytest.mark.parametrize("line", COMMANDS, ids=lambda line: line.partition("--")[0].strip())
def test_the_commands_of_its_page_run(run, project, monkeypatch, line):
    monkeypatch.chdir(project)
    words = [word.strip("'") for word in re.findall(r"'[^']*'|\S+", line.partition(" #")[0])]
    if "view" in words:
        pytest.importorskip("viser")
    for module in ("robot", "move"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    found = run(*words[1:])
    assert found.exit_code == 0, found.output
    for word in words:
        if re.fullmatch(r"\w+\.(png|csv|html|fmu)", word):
            assert (project / word).stat().st_size > 1000


def test_its_files_are_written_in_the_style_of_this_project(project):
    for name in FILES - {"README.md"}:
        text = (project / name).read_text()
        assert max(map(len, text.splitlines())) <= 125
        assert ast.get_docstring(ast.parse(text)) or name == "notebook.py"
    options = ["--line-length", "110", "--isolated", str(project)]
    found = subprocess.run(
        [sys.executable, "-m", "ruff", "format", "--check", *options],
        capture_output=True,
        text=True,
        check=False,
    )
    assert found.returncode == 0, found.stdout
    found = subprocess.run(
        [
            sys.executable,
            "-m",
            "ruff",
            "check",
            "--select",
            "E,F,W",
            "--line-length",
            "125",
            "--isolated",
            str(project),
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert found.returncode == 0, found.stdout


def test_what_is_there_is_left_alone(run, fails, tmp_path, project):
    said = fails(MISUSE, "new", "robot", project)
    assert "found README.md" in said
    assert "expected a new or an empty folder; take another name" in said
    file = tmp_path / "file"
    file.write_text("mine")
    assert "found a file, expected a new or an empty folder" in fails(MISUSE, "new", "robot", file)
    assert "cannot be made" in fails(MISUSE, "new", "robot", file / "below")
    hidden = tmp_path / "hidden"
    hidden.mkdir()
    (hidden / ".git").mkdir()
    assert "found .git in it" in fails(MISUSE, "new", "robot", hidden)
    assert file.read_text() == "mine"
    assert "robot" in run("new", "--help").stdout


def test_an_empty_folder_and_one_that_is_deep_are_taken(answer, tmp_path):
    empty = tmp_path / "empty"
    empty.mkdir()
    for folder in (empty, tmp_path / "a" / "b"):
        found = answer("new", "robot", folder)
        assert {Path(file).name for file in found["files"]} == FILES
