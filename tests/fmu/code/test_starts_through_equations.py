"""Starts declared for variables that are no states: parameters reach the states through the equations."""

import pytest

from gantrytau import Model, Parameter, Real, der, sampled, simulate, translate
from tests.fmu.exported import export


class Reached(Model):
    """y is fixed; the state x follows from it."""

    y0 = Parameter(2.0, description="start of y")
    g = Parameter(1.0, description="of y in x")
    x = Real(start=2.0, description="state")
    y = Real(start=y0, fixed=True, description="what is known at the start")

    def equations(self):
        yield self.y == self.g * self.x + 0.1 * self.x**3
        yield der(self.x) == -self.x


class Mirrored(Model):
    """The state has another name, with the other sign, and its start stands there."""

    y0 = Parameter(2.0, description="start of y")
    x = Real(description="state")
    y = Real(start=y0, fixed=True, description="alias")

    def equations(self):
        yield self.y == -self.x
        yield der(self.x) == -self.x + 0.1 * self.x**2


class Counted(Model):
    """A held variable that begins at a parameter and adds to itself."""

    i0 = Parameter(3.0, description="before the first sample")
    i = Real(start=i0, description="count")
    x = Real(start=0.0, fixed=True, description="state")

    def equations(self):
        yield sampled(self.i, self.i + 1, period=0.1)
        yield der(self.x) == self.i


CHANGES = [
    (Reached, {}),
    (Reached, {"y0": 5.0}),
    (Reached, {"g": 7.0}),
    (Reached, {"y0": -1.0, "g": 0.5}),
    (Mirrored, {"y0": 5.0}),
    (Counted, {"i0": 5.0}),
]


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize(("model", "changes"), CHANGES)
def test_parameters_act_as_in_a_fresh_model(tmp_path, model, changes, version):
    fmu = export(model(), tmp_path / "model.fmu", version)
    truth = simulate(model(**changes), stop=0.55, points=12, tolerance=1e-10)
    names = [n for n in ("x", "y", "i") if n in fmu.references]
    with fmu.new() as run:
        run.begin(**changes)
        assert run[names] == pytest.approx([truth[n][0] for n in names], abs=1e-9)
        for k in range(11):
            run.time = 0.05 * k
            run.step(0.05)
        moving = [n for n in names if n != "i"]  # at 0.55 s nothing is sampled
        assert run[moving] == pytest.approx([truth[n][-1] for n in moving], abs=1e-5)


def test_what_acts_at_the_start_only_is_fixed_and_all_else_tunable(tmp_path):
    found = {}
    for model in (Reached, Mirrored, Counted):
        described = export(model(), tmp_path / f"{model.__name__}.fmu").described
        found |= {v.name: v.variability for v in described.modelVariables if v.causality == "parameter"}
    assert found == {"y0": "fixed", "g": "tunable", "i0": "fixed"}


def test_a_state_that_is_found_is_not_set(tmp_path):
    variables = {v.name: v for v in export(Reached(), tmp_path / "m.fmu").described.modelVariables}
    assert (variables["x"].initial, variables["x"].start) == ("calculated", None)
    assert translate(Reached()).states == ("x",)
