"""Optima in units that are declared, asked for, and read from texts."""

import csv
from typing import Any

import matplotlib
import numpy as np
import pytest

from gantrytau import Input, Model, ModelError, Parameter, Real, der
from gantrytau_optimica import Free, Optimization, final, initial, load_optimum, optimize

matplotlib.use("Agg")


class Shaft(Model):
    """A shaft that is turned."""

    J = Parameter("200 kg.mm2", unit="kg.m2", display="kg.mm2", description="moment of inertia")
    phi = Real(unit="rad", display="deg", description="angle")
    w = Real(unit="rad/s", display="rpm", description="angular velocity")
    tau = Input(unit="N.m", display="N.mm", min="-0.2 N.mm", max="0.2 N.mm", description="torque")

    def equations(self):
        yield self.w == der(self.phi)
        yield self.J * der(self.w) == self.tau


class Quarter(Optimization):
    """A quarter of a turn in least time, from rest to rest: 2 sqrt(phi J / tau) = 2.507 s."""

    shaft: Any = Shaft()
    final_time: Any = Free("1500 ms", unit="s", display="ms", min="100 ms", max=10.0, description="duration")

    def objective(self):
        return self.final_time

    def constraints(self):
        yield initial(self.shaft.phi) == 0
        yield initial(self.shaft.w) == 0
        yield final(self.shaft.phi) == np.pi / 2
        yield final(self.shaft.w) == 0


@pytest.fixture(scope="module")
def quarter():
    return optimize(Quarter, elements=10, guess={"shaft.phi": "45 deg"})


def test_an_optimum_is_in_si_and_drawn_as_declared(quarter):
    assert quarter.final_time == pytest.approx(2 * np.sqrt(np.pi / 2), rel=1e-6)  # J / tau = 1 s2
    axes = quarter.plot("shaft.phi", "shaft.tau").axes
    assert [axis.get_ylabel() for axis in axes] == ["shaft.phi [deg]", "shaft.tau [N.mm]"]
    assert np.asarray(axes[0].lines[0].get_ydata())[-1] == pytest.approx(90, rel=1e-7)
    assert quarter.plot("shaft.phi", display="SI").axes[0].get_ylabel() == "shaft.phi [rad]"
    assert quarter.plot("final_time").axes[0].get_ylabel() == "final_time [ms]"
    assert quarter.playback.result.display("shaft.w") == "rpm"
    assert quarter["shaft.phi"][-1] == pytest.approx(np.pi / 2, rel=1e-7)


def test_files_of_an_optimum(quarter, tmp_path):
    path = quarter.save(tmp_path / "x.csv", display={"shaft.phi": "deg"})
    with path.open(newline="") as file:
        header, *rows = csv.reader(file)
    column = header.index("shaft.phi [deg]")
    assert "shaft.w [rad/s]" in header
    assert float(rows[-1][column]) == pytest.approx(90, rel=1e-7)
    with pytest.raises(ModelError, match="a solution is kept in SI; leave it out"):
        quarter.save(tmp_path / "x.optimum", display="deg")


def test_a_solution_on_file_keeps_what_is_declared(quarter, tmp_path):
    again = load_optimum(quarter.save(tmp_path / "x.optimum"))
    assert again.result.display("shaft.phi") == "deg"
    assert again.plot("shaft.w").axes[0].get_ylabel() == "shaft.w [rpm]"


def test_guesses_of_another_kind_are_refused():
    with pytest.raises(ModelError, match=r"guess shaft\.phi: found '45 mm', a length, expected an angle in"):
        optimize(Quarter, elements=10, guess={"shaft.phi": "45 mm"})
