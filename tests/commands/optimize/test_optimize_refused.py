"""`gantrytau optimize`: what is no problem, no guess or no option, and what is said of it."""

import pytest

import gantrytau_optimica

FAULT, MISUSE, INTERRUPTED = 1, 2, 130


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("", "moves.py holds several problems (Fastest, Impossible, "),
        (":Fastst", "moves.py has no class 'Fastst'; did you mean 'Fastest'?"),
        (
            ":Cart",
            "moves.py:Cart is a class Cart, expected a problem: "
            "a class that inherits from gantrytau_optimica.Optimization",
        ),
        (":far(distance=2)", "far is ready-made and takes no arguments; give --set distance=2 instead"),
        (":Fastest(distnce=2)", "Fastest(distnce=2): Fastest has no 'distnce'; did you mean 'distance'"),
        (":Fastest(distance=long)", "Fastest: distance=long: expected a number as 2.5"),
        (":Fastest(cart.m=2)", "what lies deeper is set by an option, --set cart.m=2"),
        (":Needy", "Needy needs way; give numbers as 'Needy(way=...)'"),
        (":Needy(wy=2)", "Needy(wy=2): Needy takes no 'wy'; did you mean 'way'?"),
    ],
)
def test_what_is_no_problem_of_the_file(fails, moves, name, message):
    assert message in fails(MISUSE, "optimize", f"{moves}{name}")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("Pendulum", "Pendulum is a class Pendulum, expected a problem"),
        ("Fastest", "Fastest: there is no problem of this name; name its file, as move.py:Fastest"),
        ("no_such_module:Fastest", "there is no problem of this name"),
        ("mov.py:Fastest", "mov.py: there is no such file; did you mean 'move.py'?"),
        ("broken:Fastest", "broken cannot be loaded. SyntaxError: invalid syntax\n  broken.py, line 1: def"),
        ("lonely_import:Fastest", "lonely_import cannot be loaded. ModuleNotFoundError: No module named"),
        (
            "models.py",
            "models.py holds no problem class, expected a problem: a class that inherits from "
            "gantrytau_optimica.Optimization; name one, as models.py:Fastest",
        ),
    ],
)
def test_what_is_no_problem_at_all(fails, move, monkeypatch, name, message):
    monkeypatch.chdir(move.parent)
    (move.parent / "broken.py").write_text("def f(:\n")
    (move.parent / "lonely_import.py").write_text("import nowhere\n")
    (move.parent / "models.py").write_text("from gantrytau_models import Pendulum\n")
    assert message in fails(MISUSE, "optimize", name)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("Divided", ["Divided.objective: integer division", "line 39: return self.final_time / (1 // 0)"]),
        ("Misspelt", ["Misspelt has no 'end_time'", "line 43: return self.end_time"]),
    ],
)
def test_a_problem_with_a_fault_is_told_with_the_line(fails, moves, name, words):
    message = fails(FAULT, "optimize", f"{moves}:{name}")
    assert all(word in message for word in words), message


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--plot", "cart.y", "--to", "a.png"), "--plot cart.y: Fastest has no variable or parameter"),
        (("--save", "a.cvs"), "a.cvs: found the suffix '.cvs'"),
        (("--set", "cart.mm=2"), "--set cart.mm: Fastest.cart has no 'mm'"),
        (("--guess", "a.txt"), "--guess a.txt: found the suffix '.txt', expected a result saved as .csv"),
        (("--guess", "a.csv"), "--guess a.csv: there is no such file; check its path"),
    ],
)
def test_misuse_is_told_before_the_work(fails, move, monkeypatch, options, message):
    monkeypatch.setattr(gantrytau_optimica, "optimize", None)
    assert message in fails(MISUSE, "optimize", move, *options)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.csv", "time [s],x\n0,1\n", "found 1 times, expected a motion over some time"),
        ("a.nc", "no netCDF", "cannot be read as a result ("),
    ],
)
def test_a_guess_that_is_no_result(fails, move, tmp_path, name, text, message):
    file = tmp_path / name
    file.write_text(text)
    assert message in fails(MISUSE, "optimize", move, "--guess", file)


def test_a_guess_of_another_model(fails, move, tmp_path):
    file = tmp_path / "a.csv"
    file.write_text("time [s],x\n0,1\n1,1\n")
    assert "the given solution has no variable of the" in fails(MISUSE, "optimize", move, "--guess", file)
