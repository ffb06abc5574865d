"""`gantrytau pareto`: a cart that is pushed a metre, where every weight has a closed form.

From rest to rest in T the least integral of f^2 is 12 m^2 d^2 / T^3; T + w 12 / T^3 is least at T^4 = 36 w.
"""

import csv

import numpy as np
import pytest

FAULT, MISUSE = 1, 2
MOVE = """\
from gantrytau import Input, Model, Parameter, Real, der
from gantrytau_optimica import Free, Optimization, final, initial

class Cart(Model):
    s = Real(unit="m", description="position")
    v = Real(unit="m/s", description="speed")
    f = Input(unit="m/s2", description="force by mass")
    square = Real(unit="m2/s4", description="its square")

    def equations(self):
        yield self.v == der(self.s)
        yield der(self.v) == self.f
        yield self.square == self.f**2

class Gentle(Optimization):
    cart = Cart()
    weight = Parameter(1.0, unit="s4/m2", description="what energy is worth")
    pair = Parameter([1.0, 2.0], unit="1")
    final_time = Free(1.0, unit="s", min=0.1, max=20.0)

    def objective(self):
        return self.final_time

    def integrand(self):
        return self.weight * self.cart.square

    def constraints(self):
        for end in (initial, final):
            yield end(self.cart.v) == 0
        yield initial(self.cart.s) == 0
        yield final(self.cart.s) == 1
"""
WEIGHTS = np.array([0.01, 0.1, 1.0])
ALONG = ("--along", "duration=final_time", "--along", "energy=integral(cart.square)")


@pytest.fixture
def move(tmp_path):
    file = tmp_path / "move.py"
    file.write_text(MOVE)
    return f"{file}:Gentle"


def test_time_against_energy_is_the_closed_form(answer, move, tmp_path):
    table, picture = tmp_path / "curve.csv", tmp_path / "curve.png"
    asked = ("pareto", move, "--values", "0.01,0.1,1", *ALONG, "--elements", 20)
    found = answer(*asked, "--output", table, "--plot", picture)
    times = (36 * WEIGHTS) ** 0.25
    # the force is a straight line, which collocation has exactly
    np.testing.assert_allclose(found["quantities"]["duration"], times, rtol=1e-6)
    np.testing.assert_allclose(found["quantities"]["energy"], 12 / times**3, rtol=1e-6)
    assert found["files"] == [str(table), str(picture)]
    assert picture.read_bytes().startswith(b"\x89PNG")
    rows = list(csv.DictReader(table.read_text().splitlines()))
    np.testing.assert_allclose([float(row["duration"]) for row in rows], times, rtol=1e-6)


def test_the_table_is_printed(run, move):
    spoken = run("pareto", move, "--values", "1", "--elements", 10)
    assert spoken.exit_code == 0
    heads, row = (line.split() for line in spoken.stdout.splitlines()[:2])
    assert heads == ["weight", "unweighed", "weighed"]
    assert [float(number) for number in row] == pytest.approx([1.0, 36**0.25, 12 / 36**0.75], rel=1e-5)


REFUSED = {
    ("--values", "1,x"): "--values 1,x: expected numbers separated by commas",
    ("--values", "1,1"): "--values",
    ("--values", "1", "--weight", "wight"): "--weight",
    ("--values", "1", "--along", "cart.s"): "--along",
    ("--values", "1", "--along", "a="): "--along a=: expected a quantity, as final_time, or a label",
    ("--values", "1", "--tolerance", "2"): "--tolerance",
    ("--values", "1", "--output", "a.xls"): "--output a.xls: found the suffix '.xls', expected .csv",
}


@pytest.mark.parametrize("options", REFUSED)
def test_wrong_options_are_told_as_options(fails, move, options):
    assert REFUSED[options] in fails(MISUSE, "pareto", move, *options)


def test_what_is_no_problem_is_refused(fails, robots):
    assert "expected a problem: a class that" in fails(MISUSE, "pareto", f"{robots}:Cart", "--values", "1")


def test_values_without_a_solution_are_told(run, move):
    """A motion of at most 20 s is worth no more than so much energy."""
    spoken = run("pareto", move, "--values", "1", "--elements", 5, "--max-iterations", 1)
    assert spoken.exit_code == FAULT
    assert "no value of weight was solved" in spoken.stderr
    assert ".optimum" not in spoken.stderr
