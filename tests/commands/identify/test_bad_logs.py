"""Bad logs of motion: each is refused by name, or told with its remedy, by every way in: record, robot, fit and command."""

import json

import numpy as np
import pytest

from gantrytau import GantryTauError
from gantrytau_optimica import MotionLog, identify
from gantrytau_optimica.identification import check_motion
from tests.optimica.identification import gantry_logs

GOOD = slice(4000, 6500)  # the end of the slow part and the fast one, 10 s
RATIO = 190.0  # N by N.m of the drives
CHANGED = 0.4 * gantry_logs.COULOMB  # N, friction of another date


def arrays():
    log = gantry_logs.log(0)[GOOD]
    return log.t.copy(), log.q.copy(), log.f.copy()


def changed(change):
    t, q, f = arrays()
    return MotionLog(*change(t, q, f))


def gap(t, q, f):
    t[2000:] += 1.0
    return t, q, f


def repeated(t, q, f):
    t[1000] = t[999]
    return t, q, f


def holes(t, q, f):
    q[[7, 9], 1] = np.nan
    return t, q, f


def outside(t, q, f):
    q[40:60, 1] += 5.0
    return t, q, f


def another_date(t, q, f):
    half = len(t) // 2
    f[half:] += CHANGED * np.sign(np.gradient(q, t, axis=0)[half:])
    return t, q, f


def constant(t, q, f):
    line = q[0] + np.outer(t, [0.02, 0.02, 0.02])
    noise = 20 * np.random.default_rng(1).standard_normal(q.shape)
    return t, line, gantry_logs.COULOMB + gantry_logs.VISCOUS * 0.02 + noise


def exchanged(q, f):
    order = [1, 0, 2]
    return q[:, order], f[:, order]


NO_LINKS = dict(link_masses=0.0)
# name: change of a good log, what is fixed, kind, and words of where and of the remedy
TOLD = {
    "gap": (gap, NO_LINKS, "gaps", "row 2000 follows a gap, up to 1 s"),
    "time repeated": (repeated, NO_LINKS, "time", "row 1000 repeats the time before or goes back"),
    "not finite": (holes, NO_LINKS, "nan", "rows 7 and 9 hold no finite numbers"),
    "torques": (lambda t, q, f: (t, q, f / RATIO), NO_LINKS, "unit of force", "divide torques by the radius"),
    "before a gear": (
        lambda t, q, f: (t, q, f / [1, 1, 20.0]),
        NO_LINKS,
        "unit of force",
        "forces in f3 are 1",
    ),
    "opposite": (lambda t, q, f: (t, q, -f), NO_LINKS, "sign of force", "change the sign of f"),
    "one opposite": (
        lambda t, q, f: (t, q, f * [-1, 1, 1]),
        NO_LINKS,
        "sign of force",
        "forces in f1 are against",
    ),
    "constant speed": (constant, NO_LINKS, "constant velocity", "masses cannot be told from such a log"),
    "saturated": (
        lambda t, q, f: (t, q, np.clip(f, -250, 250)),
        NO_LINKS,
        "saturated force",
        "leave these rows out",
    ),
    "late by one": (
        lambda t, q, f: (t, q, np.roll(f, 1, axis=0)),
        NO_LINKS,
        "delay",
        "shift the columns of f by -1 rows",
    ),
    "forces exchanged": (
        lambda t, q, f: (t, q, exchanged(q, f)[1]),
        NO_LINKS,
        "order of actuators",
        "columns f1 and f2 are exchanged",
    ),
    "actuators exchanged": (
        lambda t, q, f: (t, *exchanged(q, f)),
        NO_LINKS,
        "order of actuators",
        "columns q1, f1 and q2, f2 are exchanged",
    ),
    "friction of another date": (another_date, NO_LINKS, "held out", "friction, load or geometry changed"),
    "fixed against data": (
        lambda t, q, f: (t, q, f),
        NO_LINKS | dict(plate_mass=20.0),
        "fixed",
        "the motion contradicts plate_mass = 20",
    ),
}
REFUSED = {
    "millimetres": (lambda t, q, f: (t, q * 1e3, f), "Expected q in m and rad", "millimetres"),
    "outside": (outside, "outside of its workspace", "workspace"),
    "below minimum speed": (
        lambda t, q, f: (t, q[:1] + 1e-3 * (q - q[0]), f),
        "no joint is ever faster than minimum_speed",
        "slow",
    ),
    "two of three": (lambda t, q, f: (t, q[:, :2], f[:, :2]), "2 actuators, expected", None),
    "fewer rows than parameters": (lambda t, q, f: (t[:3], q[:3], f[:3]), "no log lasts 10 periods", None),
}


@pytest.mark.parametrize("name", TOLD)
def test_what_is_doubtful_is_told_by_function_and_command(run, tmp_path, name):
    change, fixed, kind, words = TOLD[name]
    log = changed(change)
    found = {f.kind: f.message for f in identify(gantry_logs.robot(), log, fixed=fixed).findings}
    ahead = {f.kind: f.message for f in (*check_motion(gantry_logs.robot(), log), *log.findings)}
    assert kind in found or kind in ("nan", "time", "gaps")  # at which `identify` parts the log
    assert words in (ahead | found)[kind] or words in ahead[kind]
    options = [word for n, value in fixed.items() for word in ("--fixed", f"{n}={value}")]
    file = log.save(tmp_path / "log.csv")
    answer = run("identify", file, "--robot", "GantryTau(L1)", *options, "--json")
    assert answer.exit_code == 0, answer.output
    record = json.loads(answer.stdout)
    (told, *_) = [f for f in record["findings"] if f["kind"] == kind and words in f["message"]]
    if kind in ("nan", "time", "gaps"):
        assert told["lines"] == [row + 2 for row in told["rows"]]  # below one line of names


@pytest.mark.parametrize("name", REFUSED)
def test_what_determines_nothing_is_refused_by_function_and_command(run, tmp_path, name):
    change, words, kind = REFUSED[name]
    log = changed(change)
    with pytest.raises(GantryTauError, match=words):
        identify(gantry_logs.robot(), log, fixed=NO_LINKS)
    if kind:
        assert kind in [f.kind for f in (*log.findings, *check_motion(gantry_logs.robot(), log))]
    file = log.save(tmp_path / "log.csv")
    answer = run("identify", file, "--robot", "GantryTau(L1)", "--fixed", "link_masses=0")
    assert answer.exit_code == 1
    assert words in answer.output


def test_asymmetric_friction_at_one_place_is_told_from_nothing(run, tmp_path):
    """Weight and asymmetry are one offset where the pose does not change: Dressler (2012), model 7 of section 6.1."""
    t, q, f = arrays()
    near = q.mean(axis=0) + 0.02 * (q - q.mean(axis=0))
    log = MotionLog(t, near, f)
    found = identify(gantry_logs.robot(), log, fixed=NO_LINKS, friction="asymmetric", minimum_speed=0.001)
    assert "plate_mass" in found.weak
    file = log.save(tmp_path / "log.csv")
    options = ("--fixed", "link_masses=0", "--friction", "asymmetric", "--minimum-speed", "0.001")
    answer = run("identify", file, "--robot", "GantryTau(L1)", *options, "--json")
    assert "plate_mass" in json.loads(answer.stdout)["weak"]
