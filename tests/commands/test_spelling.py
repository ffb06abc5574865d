"""Errors in the words of a command: options or keys of a file in place of arguments, no name of the function."""

from typing import Any

import pytest
import typer
from typer.main import get_command

from gantrytau import GantryTauError, ModelError, simulate
from gantrytau.border import Given
from gantrytau.commands.app import app
from gantrytau.commands.arguments.option import described, serves
from gantrytau.commands.printing.spelling import Spelling

COMMANDS: Any = get_command(app)
CALIBRATE = Spelling.of(COMMANDS.get_command(None, "calibrate"))
PLAN = Spelling().with_names({"wanted": "goal.error", "folder": "--output"})


def refused(*parts, **facts):
    return ModelError(*parts, **facts)


@pytest.mark.parametrize(
    ("spelling", "error", "message"),
    [
        (
            CALIBRATE,
            refused("expected 'nominal'", place="calibrate", found=Given("start", "linear")),
            "--start linear: expected 'nominal'",
        ),
        (
            CALIBRATE,
            refused("look at them, or take ", Given("loss", "robust"), place="calibrate"),
            "look at them, or take --robust",
        ),
        (CALIBRATE, refused("give ", Given("holdout", None)), "give --holdout none"),
        (CALIBRATE, refused("more ", Given("prior")), "more --prior"),
        (CALIBRATE, refused("'b' is none", place="prior", argument="prior"), "--prior: 'b' is none"),
        (CALIBRATE, refused("wrong", place="a.csv", argument="wanted"), "a.csv: wrong"),
        (CALIBRATE, refused("found 3", found=Given("other", 3)), "found other=3, found 3"),
        (CALIBRATE, refused("give ", Given("constraints", {"a b": 1.0})), "give --constraint a b=1.0"),
        (PLAN, refused("expected m", place="plan_calibration", found=Given("wanted", 5)), "goal.error = 5: expected m"),
        (PLAN, refused("found files", found=Given("folder", "a b")), "--output 'a b': found files"),
        (PLAN, GantryTauError("plain"), "plain"),
    ],
)  # fmt: skip
def test_arguments_become_options(spelling, error, message):
    assert spelling.message(error) == message


def served(
    first: int, *, word: str = "a", limits: "str | None" = None, many: list[str] | None = None
) -> None:
    """Serve.

    first: how many. word: which one; limits: none.
    """


def test_an_option_is_made_from_the_argument_it_stands_for():
    alone, found = typer.Typer(add_completion=False), {}

    @alone.command()
    @serves(simulate, stop="Its end.", limits="What.", max_step="In s.")
    def command(**policy):
        """Run."""
        found.update(policy)

    options = {p.name: p for p in get_command(alone).params}
    assert not options["stop"].required
    assert options["limits"].default == "warn"
    assert options["max_step"].opts == ["--max-step"]
    get_command(alone)(["--stop", "2", "--limits", "none"], standalone_mode=False)
    assert found == {"stop": 2.0, "limits": None, "max_step": None}


def test_help_is_what_the_docstring_says():
    assert described(served, "first") == "How many."
    assert described(served, "word") == "Which one."
    with pytest.raises(AssertionError):
        described(served, "many")
