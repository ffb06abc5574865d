"""Help pages: they fit the terminal, cut nothing off, speak of no Python, and end with an example that is a command."""

import re
from itertools import pairwise

import pytest
from typer.main import get_command

from gantrytau.commands.app import app

BLACK = re.compile(r"[│╭╮╰╯─]")


def commands(command, path=()):
    yield path, command
    for name in getattr(command, "places", ()):
        yield from commands(command.get_command(None, name), (*path, name))


PAGES = dict(commands(get_command(app)))
IDS = [" ".join(path) or "gantrytau" for path in PAGES]


def options_of(path):
    found = PAGES[path]
    return {opt for parameter in found.params for opt in (*parameter.opts, *parameter.secondary_opts)} | {
        "--help"
    }


@pytest.fixture
def page(monkeypatch):
    """The help of a command on a terminal of some width."""
    from typer.testing import CliRunner

    def call(path, width):
        found = CliRunner().invoke(
            app,
            [*path, "--help"],
            env={"COLUMNS": str(width), "TERMINAL_WIDTH": str(width)},
            prog_name="gantrytau",
        )
        assert found.exit_code == 0
        return found.stdout

    return call


@pytest.mark.parametrize("width", [80, 120])
@pytest.mark.parametrize("path", PAGES, ids=IDS)
def test_a_page_fits_and_speaks_of_no_python(page, path, width):
    text = page(path, width)
    assert max(map(len, text.splitlines())) <= width
    assert "…" not in text  # nothing is cut off
    words = " ".join(BLACK.sub(" ", text).split())
    for python in (
        "None",
        "<bool>",
        "<str>",
        "<float>",
        "<int>",
        "<path>",
        "list[",
        "dict(",
        "True",
        "False",
    ):
        assert python not in words, python
    for name in options_of(path):
        assert not name.startswith("--") or name in words


@pytest.mark.parametrize("path", PAGES, ids=IDS)
def test_paragraphs_are_filled(page, path):
    """No line of the description ends where the source of the command happens to."""
    text = page(path, 80)
    description = text.partition("Usage:")[2].partition("╭")[0].split("\n \n")[0]
    lines = [line.strip() for line in description.splitlines()[1:]]
    for line, following in pairwise(lines):
        if line and following:
            assert len(line) + 1 + len(following.split()[0]) > 78, line


@pytest.mark.parametrize(
    "path", [path for path, one in PAGES.items() if not hasattr(one, "places")], ids=" ".join
)
def test_a_page_ends_with_an_example_of_options_that_exist(path):
    example = PAGES[path].epilog or ""
    assert example.startswith("Example: gantrytau ")
    own = example.partition(f"gantrytau {' '.join(path)}")
    assert own[1], example
    for part in re.split(r"&&|;|\|\|?", example.removeprefix("Example: ")):
        words = part.split()
        if words[:1] != ["gantrytau"]:
            continue
        name = tuple(words[1 : 1 + len(path)])
        known = options_of(name) if name in PAGES else options_of((words[1],))
        assert {word for word in words if re.fullmatch(r"--[\w-]+", word)} <= known, part
