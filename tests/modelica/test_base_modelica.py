"""Models go out as Base Modelica and come back with the same trajectories, events included."""

import numpy as np
import pytest

from gantrytau import (
    Discrete,
    Mode,
    Model,
    ModelError,
    Parameter,
    Real,
    SolveError,
    delay,
    der,
    load_modelica,
    pre,
    reinit,
    require,
    sampled,
    simulate,
    terminate,
    time,
    transition,
    translate,
    when,
)
from gantrytau.modelica import read_tree, written
from gantrytau_models import (
    DeltaRobot,
    F1GantryTau,
    FiveDofGantryTau,
    FourBar,
    GantryTau,
    Pendulum,
    SixLinkGantryTau,
    SixLinkWithWrist,
    StewartPlatform,
    prototypes,
)
from gantrytau_models.control.tracking import ControlledRobot
from gantrytau_models.leadthrough.lead_through import LeadThrough
from gantrytau_models.leadthrough.peg_in_hole import PegInHole
from tests.families import first_of
from tests.modelica.test_parser import HERE, read


class Ball(Model):
    """A ball with every kind of instant: reinit, a chain, terminate, a sampling, a delay, a mode that turns at the start."""

    e = Parameter(0.7, unit="1")
    h = Real(unit="m", start=1.0, fixed=True)
    v = Real(unit="m/s", start=0.0, fixed=True)
    n = Discrete(0, unit="1")
    y, before = Real(unit="m"), Real(unit="m")
    mode = Mode("up", "down")

    def equations(self):
        yield der(self.h) == self.v
        yield der(self.v) == -9.81
        bounce = when(self.h <= 0, reinit(self.v, -self.e * pre(self.v)), self.n == pre(self.n) + 1)
        yield bounce.elsewhen(self.n > 5, terminate("enough"))
        yield sampled(self.y, 2 * self.h + self.y, period=0.1)
        yield self.before == delay(self.h, 0.05)
        yield transition(self.mode, "up", "down", self.v <= 0)
        yield transition(self.mode, "down", "up", self.v > 0)
        yield require(self.e < 1, "expected a loss")


class Tie(Model):
    """Two transitions that may act at once, of which none comes first."""

    x = Real(unit="1", start=0.0, fixed=True)
    mode = Mode("near", "far", "late")

    def equations(self):
        yield der(self.x) == 1
        yield transition(self.mode, "near", "far", self.x >= 0.5)
        yield transition(self.mode, "near", "late", time >= 0.5)


def written_and_read(model, folder):
    """The class that is read from the text of a model."""
    text = translate(model, units=False, events=True).equations("base-modelica")
    (folder / "model.mo").write_text(text)
    library = load_modelica(folder / "model.mo")
    assert library.names == (type(model).__name__,)
    return library[library.names[0]]


def round_trip(model, stop, folder):
    """Results of a model, and of what is read from its text."""
    both = translate(model, units=False, events=True), written_and_read(model, folder)()
    return [simulate(one, stop=stop, tolerance=1e-10) for one in both]


def assert_same(results, least):
    """All variables are the same where both results have one value; least: number of variables."""
    there, back = (t[count == 1] for t, count in (np.unique(x.time, return_counts=True) for x in results))
    common = np.intersect1d(there, back)
    assert common.size > 100
    names = [n for n in results[0].names if n in results[1].names]
    assert len(names) >= least
    for name in names:
        there, back = (np.array(one[name])[np.searchsorted(one.time, common)] for one in results)
        # a hundred times the tolerance of the integrator
        assert np.abs(there - back).max() <= 1e-8 * max(1.0, np.abs(there).max()), name


def test_events_come_back(tmp_path):
    there, back = round_trip(Ball(), 3.0, tmp_path)
    assert_same((there, back), 6)
    assert there.ended == back.ended == "enough"
    assert (back.final("n"), back["mode"][1]) == (6, 1)


def test_a_when_that_fails_comes_back(tmp_path):
    with pytest.raises(SolveError, match="two transitions of mode out of near may act at once"):
        simulate(written_and_read(Tie(), tmp_path)(), stop=1.0)


def test_a_text_that_came_back_goes_out_again(tmp_path):
    assert_same(round_trip(written_and_read(Ball(), tmp_path)(), 1.0, tmp_path), 6)


LIBRARY = {
    "pendulum": (Pendulum, 1.0),
    "four bars": (FourBar, 0.3),
    "modes and delays": (LeadThrough, 0.1),
    "robot": (lambda: GantryTau(prototypes.L1), 0.1),
    "six links": (lambda: SixLinkGantryTau(prototypes.D1), 0.1),
    "F1": (lambda: F1GantryTau(prototypes.F1), 0.1),
    "wrist": (lambda: SixLinkWithWrist(prototypes.L1), 0.1),
    "five axes": (lambda: FiveDofGantryTau(prototypes.L1), 0.1),
    "delta": (DeltaRobot, 0.1),
    "hexapod": (StewartPlatform, 0.1),
    "controlled": (lambda: ControlledRobot(prototypes.L1), 0.1),
    "peg": (PegInHole, 0.05),
}


@pytest.mark.parametrize("name", first_of(LIBRARY, 3))
def test_a_model_of_the_library_comes_back(name, tmp_path):
    build, stop = LIBRARY[name]
    assert_same(round_trip(build(), stop, tmp_path), 10)


def test_what_only_base_modelica_says():
    library = load_modelica(HERE / "base.mo")
    assert library.names == ("A.B",)  # the package and the model are one
    found = simulate(library["A.B"](), stop=2.0, tolerance=1e-10)
    assert found.final("x[1]") == pytest.approx(2 * np.exp(-2.0), abs=1e-8)
    assert found.final("z[3]") == pytest.approx(3 + 2 * (1 - np.exp(-2.0)), abs=1e-8)
    assert found.final("n") == 5


def test_base_modelica_has_one_model(tmp_path):
    (tmp_path / "none.mo").write_text("//! base 3.6.0\npackage P\n  record R\n  end R;\nend P;\n")
    with pytest.raises(
        ModelError, match=r"none\.mo, line 2, column 9: found 0 models, expected one package with"
    ):
        load_modelica(tmp_path / "none.mo")


def test_a_tree_of_base_modelica_is_written():
    tree = read_tree(HERE / "base.mo")
    assert read(written(tree)) == tree


INSTANTS = """model M
  Boolean up = time > 1.2;
  Integer whole = integer(time), n(start=0), changes(start=0), first(start=0);
equation
  when sample(0, 0.5) and up then
    n = pre(n) + 1;
  elsewhen time >= 2 then
    n = pre(n) + 100;
  end when;
  when change(whole) or change(up) then
    changes = pre(changes) + whole - pre(whole);
  end when;
  when {initial(), sample(1, 1)} then
    first = pre(first) + 1;
  end when;
end M;
"""


def test_whens_of_text_come_back(tmp_path):
    (tmp_path / "instants.mo").write_text(INSTANTS)
    results = round_trip(load_modelica(tmp_path / "instants.mo")["M"](), 2.75, tmp_path)
    for found in results:
        assert [found.final(name) for name in ("n", "changes", "first")] == [3, 2, 3]
