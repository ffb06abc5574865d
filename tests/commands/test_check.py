"""`gantrytau check`: what it says about good models, faulty ones, and those it cannot find."""

import sys

import pytest

FAULT, MISUSE = 1, 2


def test_a_pendulum_moves_in_one_way(run, answer):
    found = answer("check", "Pendulum")
    assert found["mobility"] == 1
    assert found["unknowns"] == found["equations"] == 7
    assert len(found["states"]) == 2  # an angle's worth of position, and its speed
    spoken = run("check", "Pendulum")
    assert spoken.exit_code == 0
    assert "mobility 1" in spoken.stdout


@pytest.mark.parametrize(
    ("model", "prototype"),
    [("GantryTau", "L1"), ("gantrytau_models.GantryTau", "L1"), ("GantryTau(D1)", "D1")],
)
def test_the_robot_moves_in_three_ways(answer, model, prototype):
    found = answer("check", model)
    assert found["mobility"] == 3
    assert found["prototype"] == prototype


def test_the_prototype_that_was_not_named_is_told(run):
    assert "takes its measures from prototype L1; choose another with" in run("check", "GantryTau").stderr
    assert run("check", "GantryTau", "--prototype", "GT_A").stderr == ""


def test_models_of_a_file(run, answer, robots):
    assert answer("check", f"{robots}:Runaway")["states"] == ["x"]
    assert answer("check", f"{robots}:robot")["mobility"] == 3
    assert "loading" in run("check", f"{robots}:Runaway", "--json").stderr


def test_the_only_class_of_a_file_needs_no_name(answer, tmp_path):
    file = tmp_path / "one.py"
    file.write_text("from gantrytau_models import Pendulum\nclass Long(Pendulum):\n    '''Long.'''\n")
    assert answer("check", file)["model"] == "Long"


def test_neighbours_of_a_file_are_those_beside_it_as_they_stand_now(answer, tmp_path):
    """Two of one name in two folders are two, and one that is edited is read anew."""
    for name, mass in (("one", 1.0), ("two", 2.0), ("one", 3.0)):
        folder = tmp_path / name
        folder.mkdir(exist_ok=True)
        (folder / "geometry.py").write_text(f"MASS = {mass}  # {'kg' * int(mass)}\n")
        robot = "from geometry import MASS\nfrom gantrytau_models import Pendulum\nheavy = Pendulum(m=MASS)\n"
        (folder / "robot.py").write_text(robot)
        final = answer("simulate", f"{folder / 'robot.py'}:heavy", "--stop", "0.1", "--outputs", "m")["final"]
        assert final["m"] == mass
    assert "geometry" not in sys.modules


@pytest.mark.parametrize(
    ("model", "prototype"),
    [
        ("GantryTau(D1, plate_mass=11)", "D1"),
        ("GantryTau(plate_mass=11)", "L1"),
        ("gantrytau_models:GantryTau(plate_mass=11, prototypes.D1)", "D1"),
    ],
)
def test_a_prototype_stands_beside_other_arguments(answer, model, prototype):
    assert answer("check", model)["prototype"] == prototype


@pytest.mark.parametrize(
    ("model", "message"),
    [
        ("pendulm", "pendulm: the library has no model of this name; did you mean 'Pendulum'?"),
        ("gantrytau.Result", "gantrytau.Result is a class Result, expected a model"),
        ("GantryTau(d1)", "--prototype d1: there is no prototype 'd1'; did you mean 'D1'?"),
        ("Pendulum(L1)", "Pendulum takes no prototype; leave L1 out"),
        (("GantryTau(D1)", "--prototype", "L1"), "found the prototype D1 in GantryTau(D1) and --prototype"),
        ("GantryTau(F1_ideal)", "GantryTau cannot take the measures of this kind of robot, expected one of"),
        ("robot.txt:Robot", "the library has no model of this name"),
        ("no_such_folder/robot.py:Cart", "there is no such file."),
    ],
)
def test_a_model_that_is_not_there(fails, model, message):
    assert message in fails(MISUSE, "check", *((model,) if isinstance(model, str) else model))


def test_a_class_gets_the_first_prototype_of_the_kind_it_takes(run, tmp_path):
    file = tmp_path / "rotating.py"
    file.write_text(
        "from gantrytau_models import Pendulum, prototypes\n"
        "class Rotating(Pendulum):\n"
        "    def __init__(self, prototype: prototypes.RotatingPrototype):\n"
        "        super().__init__(m=prototype.plate_mass)\n"
        "class Vague(Pendulum):\n"
        "    def __init__(self, prototype: 'no such class'):\n"
        "        super().__init__(m=prototype.plate_mass)\n"
    )
    assert "from prototype F1;" in run("check", f"{file}:Rotating").stderr
    assert "from prototype L1;" in run("check", f"{file}:Vague").stderr


def test_a_prototype_in_doubt_says_so(run, tmp_path):
    file = tmp_path / "rotating.py"
    file.write_text(
        "from gantrytau_models import Pendulum\n"
        "class Any(Pendulum):\n"
        "    def __init__(self, prototype):\n"
        "        super().__init__()\n"
    )
    found = run("check", f"{file}(F1_printed)")
    assert found.exit_code == 0
    assert "Note: prototypes.F1_printed: " in found.stderr


@pytest.mark.parametrize(
    ("name", "message"),
    [
        (":Crt", "robots.py has no class 'Crt'; did you mean 'Cart'?"),
        (":number", "robots.py:number is a int, expected a model: a class that inherits from"),
        ("", "robots.py holds several models (Cart, Misspelt,"),
        (":Needy", "Needy needs mass; give numbers as 'Needy(mass=...)', and write all else in a file: "),
        (":robot(L1)", "robot is ready-made and takes no prototype; leave L1 out"),
    ],
)
def test_a_name_that_is_no_model_of_the_file(fails, robots, name, message):
    assert message in fails(MISUSE, "check", f"{robots}{name}")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("def f(:\n", ["SyntaxError: invalid syntax", "broken.py, line 1: def f(:"]),
        (
            "def f():\n    return 1 / 0\nf()\n",
            ["ZeroDivisionError", "broken.py, line 3: f()", "broken.py, line 2: return 1 / 0"],
        ),
        ("import sys\nsys.exit('enough')\n", ["SystemExit: enough", "broken.py, line 2"]),
    ],
)
def test_a_file_that_cannot_be_loaded_shows_its_lines(fails, tmp_path, text, words):
    file = tmp_path / "broken.py"
    file.write_text(text)
    message = fails(MISUSE, "check", f"{file}:Robot")
    assert "broken.py cannot be loaded. " in message
    assert all(word in message for word in words), message


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Cart", ["m (mass, kg) has no value"]),
        ("Unfinished", ["Unfinished: 2 unknowns, 1 equation. Undetermined: x"]),
        (
            "Misspelt",
            ["Misspelt has no 'force'", "robots.py, line 24: yield self.m * der(self.v) == self.force"],
        ),
        ("Divided", ["integer division or modulo by zero", "robots.py, line 31: yield"]),
    ],
)
def test_a_model_with_a_fault_is_told_with_the_line(fails, robots, name, words):
    message = fails(FAULT, "check", f"{robots}:{name}")
    assert all(word in message for word in words), message


def test_a_bug_of_the_toolkit_is_not_hidden(run, monkeypatch):
    def broken(model, **choices):
        raise KeyError("inside")

    monkeypatch.setattr("gantrytau.check", broken, raising=False)
    assert isinstance(run("check", "Pendulum").exception, KeyError)


def test_ctrl_c_says_that_nothing_was_written(fails, monkeypatch):
    def pressed(model, **choices):
        raise KeyboardInterrupt

    monkeypatch.setattr("gantrytau.check", pressed, raising=False)
    assert fails(130, "check", "Pendulum") == "Interrupted; nothing was written"
