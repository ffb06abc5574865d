"""Problems of a user in files, for the tests of `gantrytau optimize`."""

import json

import pytest

PROBLEMS = '''\
"""Problems of a user."""
from gantrytau import Input, Model, Parameter, Real, der
from gantrytau_optimica import Free, Optimization, final, link

print("loading")

class Cart(Model):
    """A cart that is pushed."""

    m = Parameter(1.0, unit="kg", description="mass")
    x = Real(unit="m", start=0.0, fixed=True)
    v = Real(2, unit="m/s", start=[0.0, 0.0], fixed=True)
    f = Input(unit="N", min=-1.0, max=1.0)

    def equations(self):
        yield self.v[0] == der(self.x)
        yield self.m * der(self.v[0]) == self.f
        yield self.m * der(self.v[1]) == 0 * self.f

class Fastest(Optimization):
    """From rest to rest with a limited force."""

    cart = Cart()
    distance = Parameter(1.0, unit="m")
    final_time = Free(1.5, unit="s", min=0.1, max=20.0, description="duration")

    def objective(self):
        return self.final_time

    def constraints(self):
        yield final(self.cart.x) == self.distance
        yield final(self.cart.v[0]) == 0
'''

MORE = """
class Impossible(Fastest):
    final_time = Free(1.0, unit="s", min=0.1, max=1.5)

class Divided(Fastest):
    def objective(self):
        return self.final_time / (1 // 0)

class Misspelt(Fastest):
    def objective(self):
        return self.end_time

class Back(Fastest):
    cart = Cart(x=dict(fixed=False), v=dict(fixed=False))
    start_time = Free(2.0, unit="s")
    final_time = Free(4.0, unit="s")

class ThereAndBack(Optimization):
    out = Fastest()
    back = Back(distance=0.0)

    def objective(self):
        return self.back.final_time

    def constraints(self):
        yield link(self.out, self.back)

class Needy(Fastest):
    def __init__(self, way):
        super().__init__(distance=way)

far = Fastest(distance=4.0)
"""


@pytest.fixture
def move(tmp_path):
    """A file with one problem, and a model beside it."""
    file = tmp_path / "move.py"
    file.write_text(PROBLEMS)
    return file


@pytest.fixture
def moves(tmp_path):
    """A file with several problems."""
    file = tmp_path / "moves.py"
    file.write_text(PROBLEMS + MORE)
    return file


@pytest.fixture
def unsolved(run):
    """The record and the message of a problem that is not solved."""

    def call(code, *arguments):
        spoken, printed = run("optimize", *arguments), run("optimize", *arguments, "--json")
        assert (spoken.exit_code, printed.exit_code) == (code, code), spoken.output
        assert spoken.stdout == ""
        report = json.loads(printed.stdout)
        assert report["success"] is False
        assert report["error"] in spoken.stderr
        assert report["error"] in printed.stderr
        assert "Traceback" not in spoken.output + printed.output
        return report

    return call
