"""`gantrytau library`, and help for those who are new."""

import pytest

import gantrytau_models
from gantrytau.border import listed
from gantrytau.mechanics.multibody import Prismatic
from gantrytau_models import prototypes


def test_the_library_lists_models_components_and_prototypes(answer):
    found = answer("library")
    parts = {"prototypes", "cart_servos", "SerialWrist", "WithWrist", "WithRacks", "PreslidingFriction"}
    assert set(found["models"]) == set(gantrytau_models.__all__) - parts
    assert Prismatic.__doc__ is not None
    assert found["components"]["gantrytau.mechanics.multibody"]["Prismatic"] in Prismatic.__doc__
    assert (
        found["components"]["gantrytau.blocks"]["Limiter"] == "y = u, at least `lower` and at most `upper`."
    )
    assert "DcMotor" in found["components"]["gantrytau.electrical"]
    assert found["prototypes"]["L1"] == prototypes.L1.source
    assert {"D1", "GT_A", "F1_printed"} <= found["prototypes"].keys()


def test_what_is_listed_explains_itself(answer):
    found = answer("library")
    groups = (found["models"], found["prototypes"], *found["components"].values())
    assert [name for group in groups for name, words in group.items() if not words] == []


def test_parts_of_robots_are_no_models_of_their_own(answer):
    found = answer("library")
    assert "F1WithWrist" in found["models"]
    assert set(found["components"]["gantrytau_models"]) == {
        "SerialWrist",
        "WithWrist",
        "WithRacks",
        "PreslidingFriction",
    }


def test_a_component_is_listed_where_it_is_at_home(answer):
    components = answer("library")["components"]
    assert "Flange" in components["gantrytau.mechanics.rotational"]
    assert "Model" not in components["gantrytau.mechanics.rotational"]


def test_the_library_is_printed(run):
    lines = run("library").stdout.splitlines()
    assert any(line.split()[:1] == ["Pendulum"] for line in lines)
    assert "Components of gantrytau.mechanics.translational" in lines


@pytest.mark.parametrize("command", ["check", "simulate", "optimize", "equations", "library"])
def test_each_command_has_help_with_an_example(run, command):
    found = run(command, "--help")
    assert found.exit_code == 0
    assert f"Example: gantrytau {command}" in found.stdout
    assert "--json" in found.stdout


def test_brackets_in_the_help_are_not_taken_for_markup(run):
    assert "'offset=[1,2,3]'" in run("check", "--help").stdout
    assert "carts[0].s,carts[1].s,carts[2].s" in run("equations", "--help").stdout


def test_names_are_separated_by_commas_outside_of_brackets():
    assert listed(["a, b", "R[0,1],der(tool.r[2])", " "]) == ("a", "b", "R[0,1]", "der(tool.r[2])")
    assert listed(None) == ()


def test_components_and_models_are_described(run, answer):
    said = run("describe", "Revolute").stdout
    assert "A joint that turns about an axis" in said
    assert "angle from frame_a to frame_b about n" in said
    assert answer("describe", "gantrytau.mechanics.multibody.Revolute")["title"] == "Revolute"
    (mass, *_) = answer("describe", "GantryTau(L1)")["Parameters"]
    assert (mass["name"], float(mass["value"])) == ("plate_mass", prototypes.L1.plate_mass)
    assert answer("describe", "GantryTau(D1)", "tool.r")["Attributes"][1] == {"name": "unit", "value": "m"}


def test_components_of_one_name_are_told_apart_by_their_modules(run, answer, fails):
    for module in ("translational", "rotational", "multibody"):
        assert answer("describe", f"{module}.Fixed")["kind"].startswith(
            f"model of gantrytau.mechanics.{module}"
        )
    said = run("describe", "Fixed")
    assert "multibody.Fixed" in said.stderr
    assert "rotational.Fixed" in said.stderr
    assert "Of the same name" not in run("describe", "Revolute").stderr
    assert "the library has nothing of this name" in fails(2, "describe", "multibody.Revolut")
    assert "the library has nothing of this name" in fails(2, "describe", "rotational.Revolute")


def test_units_that_are_shown_are_told_beside_those_of_numbers(answer):
    assert answer("describe", "Revolute")["shown in"].startswith(
        "deg for rad, deg/s for rad/s; a number that you give is in SI"
    )
    rows = {row["name"]: row["value"] for row in answer("describe", "Revolute", "phi")["Attributes"]}
    assert (rows["unit"], rows["unit of numbers in models"]) == ("deg", "rad")
    assert "shown in" not in answer("describe", "Spring")


def test_models_of_a_file_are_described(answer, robots):
    assert answer("describe", f"{robots}:Runaway")["title"] == "Runaway"


def test_what_is_not_there_is_not_described(fails):
    assert "the library has nothing of this name; did you mean 'Revolute'?" in fails(2, "describe", "Revolut")
    assert "GantryTau has no 'tol'; did you mean 'tool'" in fails(1, "describe", "GantryTau(L1)", "tol.r")
