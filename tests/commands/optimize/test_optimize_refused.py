"""`gantrytau optimize`: what is no problem, no guess or no option, and what is said of it."""

import pytest

import gantrytau_optimica

FAULT, MISUSE, INTERRUPTED = 1, 2, 130


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("", "moves.py holds several problems (Fastest, Impossible, "),
        (
            ":Cart",
            "moves.py:Cart is a class Cart, expected a problem: "
            "a class that inherits from gantrytau_optimica.Optimization",
        ),
        (":far(distance=2)", "far is ready-made and takes no arguments; give --set distance=2 instead"),
        (":Fastest(distance=long)", "Fastest: distance=long: expected a number as 2.5"),
        (":Fastest(cart.m=2)", "what lies deeper is set by an option, --set cart.m=2"),
    ],
)
def test_what_is_no_problem_of_the_file(fails, moves, name, message):
    assert message in fails(MISUSE, "optimize", f"{moves}{name}")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("Pendulum", "Pendulum is a class Pendulum, expected a problem"),
        ("Fastest", "Fastest: there is no problem of this name; name its file, as move.py:Fastest"),
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
