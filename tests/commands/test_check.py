"""`gantrytau check`: what it says about good models, faulty ones, and those it cannot find."""

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
    assert (
        "takes its measures from prototype L1; choose another with --prototype"
        in run("check", "GantryTau").stderr
    )
    assert run("check", "GantryTau", "--prototype", "GT_A").stderr == ""


def test_models_of_a_file(run, answer, robots):
    assert answer("check", f"{robots}:Runaway")["states"] == ["x"]
    assert answer("check", f"{robots}:robot")["mobility"] == 3
    assert "loading" in run("check", f"{robots}:Runaway", "--json").stderr


def test_the_only_class_of_a_file_needs_no_name(answer, tmp_path):
    file = tmp_path / "one.py"
    file.write_text("from gantrytau_models import Pendulum\nclass Long(Pendulum):\n    '''Long.'''\n")
    assert answer("check", file)["model"] == "Long"


def test_a_file_may_import_its_neighbours(answer, tmp_path):
    (tmp_path / "neighbour_of_one.py").write_text("from gantrytau_models import Pendulum\n")
    file = tmp_path / "one.py"
    file.write_text("from neighbour_of_one import Pendulum\nclass Long(Pendulum):\n    '''Long.'''\n")
    assert answer("check", f"{file}:Long")["mobility"] == 1


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


def test_a_number_is_no_component(fails):
    assert "tool: found 2 as modification, expected a component" in fails(FAULT, "check", "GantryTau(tool=2)")


def test_a_component_has_a_full_name(answer):
    assert answer("check", "gantrytau.mechanics.translational.Mass")["states"] == ["s", "v"]


@pytest.mark.parametrize(
    ("model", "message"),
    [
        ("pendulm", "pendulm: the library has no model of this name; did you mean 'Pendulum'?"),
        ("gantrytau", "did you mean 'GantryTau'?"),
        ("gantrytau.Nothing", "the library has no model of this name"),
        ("no_such_package.Robot", "the library has no model of this name"),
        ("gantrytau.Result", "gantrytau.Result is a class Result, expected a model"),
        ("GantryTau(d1)", "--prototype d1: there is no such robot; did you mean 'D1'?"),
        ("Pendulum(L1)", "Pendulum takes no prototype; leave L1 out"),
    ],
)
def test_a_model_that_is_not_there(fails, model, message):
    assert message in fails(MISUSE, "check", model)


def test_two_prototypes_are_one_too_many(fails):
    message = fails(MISUSE, "check", "GantryTau(D1)", "--prototype", "L1")
    assert "found the prototype D1 in GantryTau(D1) and --prototype L1" in message


def test_a_prototype_of_another_kind_is_refused(fails):
    message = fails(MISUSE, "check", "GantryTau(F1_ideal)")
    assert (
        "F1_ideal: GantryTau cannot take the measures of this kind of robot, expected one of D1, " in message
    )


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
        (
            ":number",
            "robots.py:number is a int, expected a model: a class that inherits from gantrytau.Model",
        ),
        ("", "robots.py holds several models (Cart, Misspelt,"),
        (":Needy", "Needy needs mass; give numbers as 'Needy(mass=...)', and write all else in a file: "),
        (":robot(L1)", "robot is ready-made and takes no prototype; leave L1 out"),
    ],
)
def test_a_name_that_is_no_model_of_the_file(fails, robots, name, message):
    assert message in fails(MISUSE, "check", f"{robots}{name}")


def test_what_is_no_python_file(fails, tmp_path):
    file = tmp_path / "robot.txt"
    file.write_text("x = 1\n")
    assert f"{file} is no Python file, expected one, as robot.py:Robot" in fails(MISUSE, "check", file)
    assert f"{tmp_path}:Robot is no Python file" in fails(MISUSE, "check", f"{tmp_path}:Robot")


def test_a_file_without_models(fails, tmp_path):
    file = tmp_path / "empty.py"
    file.write_text("x = 1\n")
    assert "empty.py holds no model class; name one, as empty.py:Robot" in fails(MISUSE, "check", file)


def test_a_file_that_is_not_there(fails, robots):
    message = fails(MISUSE, "check", f"{robots.parent / 'robot.py'}:Cart")
    assert "robot.py: there is no such file; did you mean 'robots.py'?" in message
    assert "there is no such file." in fails(MISUSE, "check", "no_such_folder/robot.py:Cart")


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


def test_a_declaration_in_a_list_is_told_with_its_line(fails, tmp_path):
    file = tmp_path / "lists.py"
    file.write_text("from gantrytau import Model, Real\nclass Robot(Model):\n    parts = [Real(), Real()]\n")
    message = fails(FAULT, "check", file)
    assert "Robot.parts is a list of declarations" in message
    assert "lists.py, line 2: class Robot(Model):" in message


def test_a_bug_of_the_toolkit_is_not_hidden(run, monkeypatch):
    def broken(model, **choices):
        raise KeyError("inside")

    monkeypatch.setattr("gantrytau.translate", broken)
    monkeypatch.setattr("gantrytau.check", broken, raising=False)
    assert isinstance(run("check", "Pendulum").exception, KeyError)


def test_ctrl_c_says_that_nothing_was_written(fails, monkeypatch):
    def pressed(model, **choices):
        raise KeyboardInterrupt

    monkeypatch.setattr("gantrytau.translate", pressed)
    monkeypatch.setattr("gantrytau.check", pressed, raising=False)
    assert fails(130, "check", "Pendulum") == "Interrupted; nothing was written"
