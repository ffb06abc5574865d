"""Errors name the options of commands: every argument that a message is about, wherever in the packages it is raised."""

import ast
import re
from pathlib import Path

import pytest

import gantrytau
import gantrytau_fmu
import gantrytau_optimica
from gantrytau import ModelError
from gantrytau.commands import equations_command, simulate_command
from gantrytau.commands.arguments import solver_options
from gantrytau.commands.calibrate import calibration_options, plan_command
from gantrytau.commands.fmu import export_options, fmu_run
from gantrytau.commands.printing.spelling import Spelling

OPTIMIZE, CALIBRATE = solver_options.SPELLING, calibration_options.SPELLING
PLAN, RUN = plan_command.SPELLING, fmu_run.SPELLING
COMMANDS = {
    "simulate": simulate_command.SPELLING,
    "equations": equations_command.SPELLING,
    "optimize": OPTIMIZE,
    "calibrate": CALIBRATE,
    "calibrate cell.toml": PLAN,
    "fmu export": export_options.SPELLING,
    "fmu run": RUN,
}


def written(node):
    """A message as it stands in the source, with a word for what is filled in."""
    if isinstance(node, ast.Constant):
        return str(node.value)
    if isinstance(node, ast.JoinedStr):
        return "".join(written(part) for part in node.values)
    if isinstance(node, ast.FormattedValue):
        return "'filled'" if node.conversion == ord("r") else "filled"
    return "filled"


def sites():
    """Arguments and messages of all errors that name an argument, with file and line."""
    for package in (gantrytau, gantrytau_optimica, gantrytau_fmu):
        for file in sorted(Path(str(package.__file__)).parent.rglob("*.py")):
            for node in ast.walk(ast.parse(file.read_text())):
                if isinstance(node, ast.Call):
                    named = {keyword.arg: keyword.value for keyword in node.keywords}
                    argument = named.get("argument")
                    if isinstance(argument, ast.Constant) and node.args:
                        yield f"{file.name}:{node.lineno}", str(argument.value), written(node.args[0])


@pytest.mark.parametrize("command", COMMANDS)
def test_every_error_on_an_argument_names_the_option(command):
    spelling, found = COMMANDS[command], 0
    for place, argument, message in sites():
        if argument not in spelling.options:
            continue
        found += 1
        said = spelling.of(ModelError(message, argument=argument))
        assert spelling.options[argument] in said, place
        assert re.search(rf"\b({'|'.join(spelling.options)})=(?!=)", said) is None, (place, said)
        assert not said.startswith(spelling.functions), (place, said)
    assert found > 2


def test_what_is_said_in_other_words_is_written_in_the_packages():
    """A reworded sentence shows up here, not as Python on a terminal."""
    roots = [Path(str(package.__file__)).parent for package in (gantrytau, gantrytau_optimica, gantrytau_fmu)]
    sources = [
        file.read_text()
        for root in roots
        for file in root.rglob("*.py")
        if root / "commands" not in file.parents
    ]
    text = re.sub(r'"\n\s*f?"', "", "\n".join(sources)).replace("{{", "{").replace("}}", "}")
    for command, spelling in COMMANDS.items():
        for python in spelling.exactly:
            assert python in text, (command, python)


@pytest.mark.parametrize(
    ("spelling", "said", "argument", "spoken"),
    [
        (CALIBRATE, "calibrate: found start='linear' for F1, expected 'nominal'", "start", None),
        (CALIBRATE, "measure more poses, or give holdout=None", None, "measure more poses, or give --holdout none"),
        (CALIBRATE, "look at them, or take loss='robust'", None, "look at them, or take --robust"),
        (CALIBRATE, "calibrate: constraints: 'b' is not identified", "constraints", "--constraint: 'b' is not identified"),
        (
            CALIBRATE,
            "calibrate: found model=2 for F1, expected model=None; those models",
            "model",
            "--model 2 for F1: expected no --model; those models",
        ),
        (RUN, "start a.b: found 'x', expected a number", "start", "--set a.b: found 'x', expected a number"),
        (RUN, "run one of them in its own: isolate=['a']", "isolate", "run one of them in its own: --isolate"),
        (OPTIMIZE, "the accuracy must lie between 0 and 1", "refine", "--refine: the accuracy must lie between 0 and 1"),
        (OPTIMIZE, "where `guess==2` holds, try another guess=", None, "where `guess==2` holds, try another --guess"),
        (PLAN, "plan_calibration.wanted: found 5", "wanted", "goal.error: found 5"),
    ],
)  # fmt: skip
def test_arguments_become_options(spelling, said, argument, spoken):
    spoken = spoken or "--start linear for F1: expected 'nominal'"
    assert spelling.of(ModelError(said, argument=argument)) == spoken


def test_a_dictionary_is_told_as_name_and_value():
    said = Spelling((), {"inputs": "--input"}).words("give inputs={'carts[0].f': ...}, or inputs={'f': 2}")
    assert said == "give --input carts[0].f=..., or --input f=2"
