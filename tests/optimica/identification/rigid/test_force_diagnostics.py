"""What is left of forces: mistakes are told by their kind, sound logs are told nothing, and deviations are those counted."""

from dataclasses import replace

import numpy as np
import pytest

from gantrytau import Input, Model, Parameter, Real, der
from gantrytau_models import CartServo
from gantrytau_optimica import MotionLog, Rig, identify
from tests.optimica.identification.rigid import axes


def deviations_off(found):
    return np.array([(found.parameters[n] - x) / found.deviations[n] for n, x in axes.TRUE.items()])


def kinds(found):
    return [f.kind for f in found.findings]


def test_a_sound_log_is_told_nothing():
    for seed in range(2):
        found = identify(axes.two(), axes.log(seed))
        assert kinds(found) == []
        assert np.abs(deviations_off(found)).max() < 4
        assert min(found.diagnostics.explained.values()) > 0.99


MISTAKES = {
    "spring": ("trend", dict(extra=200 * axes.motion()[0])),
    "nothing of this motion": ("explains nothing", dict(extra=0.0)),
    "weight": ("trend", dict(extra=30.0)),
    "drift": ("drift", dict(extra=0.5 * axes.T[:, None])),
    "opposite mass": ("limit", dict(extra=-40 * axes.motion()[2])),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_robot_that_is_not_the_model_is_told(name):
    kind, extra = MISTAKES[name]
    log = axes.log(7, **extra)
    if name == "nothing of this motion":
        log = replace(log, f=np.random.default_rng(0).normal(0, 50, log.q.shape))
    found = identify(axes.two(), log)
    told = [f for f in found.findings if f.kind == kind]
    assert told
    words = {
        "spring": "follows q of x.s",
        "weight": "follows 1",
        "opposite mass": "x.mass.m stands at its limit 0",
    }
    assert words.get(name, "") in told[0].message


def test_a_weight_beside_asymmetric_friction_pulls_at_its_limit():
    found = identify(axes.two(), axes.log(7, extra=30.0), friction="asymmetric")
    assert any("coulomb[0][1] stands at its limit 0" in f.message for f in found.findings)


def test_a_log_that_comes_twice_and_one_whose_time_goes_back_are_told():
    log = axes.log(1)
    assert "duplicates" in kinds(identify(axes.two(), [log, log]))
    back = replace(log, t=np.where(log.t > 10, log.t - 5.0, log.t))
    assert "time" in kinds(identify(axes.two(), back))


@pytest.mark.parametrize("seeds", [1, pytest.param(10, marks=pytest.mark.nightly)])
def test_noise_of_positions_is_taken_out(seeds):
    """0.5 mm makes masses 7 deviations too small where it is left in; counted over ten seeds it is below one."""
    found = [identify(axes.two(), axes.log(seed, encoder=5e-4)) for seed in range(seeds)]
    assert np.abs(np.mean([deviations_off(one) for one in found], axis=0)).max() < 1 + 2 / np.sqrt(seeds)
    assert all(kinds(one) == ["noise of positions"] for one in found)
    assert kinds(identify(axes.two(), axes.log(0, encoder=1e-5))) == []


@pytest.mark.parametrize("seeds", [1, pytest.param(10, marks=pytest.mark.nightly)])
def test_rows_that_are_lost_are_put_in_again(seeds):
    """One of fifty, at times that go on evenly: masses were 15 deviations too small."""
    off = []
    for seed in range(seeds):
        whole = axes.log(seed, encoder=1e-6)
        kept = np.sort(np.random.default_rng(seed).choice(axes.ROWS, 4900, replace=False))
        found = identify(axes.two(), MotionLog(axes.T[:4900], whole.q[kept], whole.f[kept]))
        off.append(deviations_off(found))
        lost = next(f for f in found.findings if f.kind == "lost rows")
        missing = np.flatnonzero(np.diff(kept) > 1) + 1
        assert np.isin(lost.rows, missing).all()  # rows of the file, none of which is whole
        assert len(lost.rows) > 0.9 * len(missing)
        assert "here they are put in again" in lost.message
    assert np.abs(np.mean(off, axis=0)).max() < 1 + 2 / np.sqrt(seeds)


def test_the_run_of_a_rig_identifies_its_robot():
    """Forces jump by a half at each sample; those that were logged at samples made the mass 69 % too large."""
    t = 0.004 * np.arange(1500)
    q = (0.3 * np.sin(1.45 * t) + 0.1 * np.sin(3.8 * t) + 0.05 * np.sin(8.2 * t)) * (1 - np.exp(-(t**2)))
    rig = Rig(axes.Lone(), [CartServo(k_v=300 * 20.0)], period=0.004)
    run = rig.run(q[:, None], np.gradient(q, t)[:, None])
    found = [identify(rig.robot, MotionLog.of(run, rig.robot, force=2.0, seed=seed)) for seed in range(4)]
    for name, true in {"x.m": 20.0, "coulomb[0]": 25.0, "viscous[0]": 60.0}.items():
        off = np.mean([one.parameters[name] for one in found]) - true
        assert abs(off) < 2 * found[0].deviations[name]


def test_the_friction_of_the_model_is_identified_where_it_is_kept():
    """As the finding on the law of friction advises: one that is smoothed near rest, within 0.05 m/s."""
    q, v, a = (x[:, 0] for x in axes.motion())
    smooth = 25 * a + 12 * np.tanh(v / 0.05) + 30 * v + np.random.default_rng(0).normal(size=len(q))
    robot, log = axes.Lone(x=axes.Rubbed(v_0=0.05)), MotionLog(axes.T, q, smooth)
    assert "law of friction" in kinds(identify(robot, log))
    found = identify(robot, log, friction=None)
    assert kinds(found) == []
    for name, true in {"x.m": 25.0, "x.f_c": 12.0, "x.f_v": 30.0}.items():
        assert abs(found.parameters[name] - true) < 3 * found.deviations[name]
    assert identify(robot, log, friction=None, fixed={"x.f_v": 30.0}).fixed == {"x.f_v": 30.0}


class Slide(Model):
    """A drive at the top of a model."""

    m = Parameter(2.0, unit="kg", min=0)
    f, s, v = Input(unit="N", start=0.0), Real(unit="m", start=0.0), Real(unit="m/s", start=0.0)

    def equations(self):
        yield der(self.s) == self.v
        yield self.m * der(self.v) == self.f


def test_drives_may_stand_at_the_top_of_a_model():
    t = 0.004 * np.arange(3000)
    found = identify(Slide(), MotionLog(t, np.sin(t), -3 * np.sin(t)), friction=None)
    assert found.parameters["m"] == pytest.approx(3, rel=1e-4)  # splines of sines


@pytest.mark.nightly
def test_told_deviations_are_those_counted():
    """Over 40 seeds, with white noise of the forces and of the positions: a count has a deviation of 11 %."""
    for encoder in (0.0, 2e-4):
        found = [identify(axes.two(), axes.log(seed, encoder=encoder)) for seed in range(40)]
        told = np.sqrt(np.mean([[one.deviations[n] ** 2 for n in axes.TRUE] for one in found], axis=0))
        counted = np.std([[one.parameters[n] for n in axes.TRUE] for one in found], axis=0, ddof=1)
        assert np.all((told / counted > 0.8) & (told / counted < 1.25))
