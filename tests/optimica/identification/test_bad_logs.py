"""Bad logs of a robot of which only all its actuators, or the fit, tell what is wrong: each with its remedy."""

import numpy as np
import pytest

from gantrytau_optimica import MotionLog, identify
from tests.optimica.identification import gantry_logs

GOOD = slice(4000, 6500)  # the end of the slow part and the fast one, 10 s
CHANGED = 0.4 * gantry_logs.COULOMB  # N, friction of another date
EXCHANGED = [1, 0, 2]
NO_LINKS = dict(link_masses=0.0)


def arrays():
    log = gantry_logs.log(0)[GOOD]
    return log.t.copy(), log.q.copy(), log.f.copy()


def another_date(t, q, f):
    half = len(t) // 2
    f[half:] += CHANGED * np.sign(np.gradient(q, t, axis=0)[half:])
    return t, q, f


TOLD = {  # name: change of a good log, kind, and words of where or of the remedy
    "before a gear": (lambda t, q, f: (t, q, f / [1, 1, 20.0]), "unit of force", "forces in f3 are 1"),
    "one opposite": (lambda t, q, f: (t, q, f * [-1, 1, 1]), "sign of force", "forces in f1 are against"),
    "forces exchanged": (
        lambda t, q, f: (t, q, f[:, EXCHANGED]),
        "order of actuators",
        "columns f1 and f2 are exchanged",
    ),
    "actuators exchanged": (
        lambda t, q, f: (t, q[:, EXCHANGED], f[:, EXCHANGED]),
        "order of actuators",
        "columns q1, f1 and q2, f2 are exchanged",
    ),
    "friction of another date": (another_date, "held out", "friction, load or geometry changed"),
}


@pytest.mark.parametrize("name", TOLD)
def test_what_is_doubtful_is_told_with_its_remedy(name):
    change, kind, words = TOLD[name]
    found = identify(gantry_logs.robot(), MotionLog(*change(*arrays())), fixed=NO_LINKS).findings
    assert any(words in one.message for one in found if one.kind == kind)


def test_asymmetric_friction_at_one_place_is_told_from_nothing():
    """Weight and asymmetry are one offset where the pose does not change: Dressler (2012), model 7 of section 6.1."""
    t, q, f = arrays()
    near = MotionLog(t, q.mean(axis=0) + 0.02 * (q - q.mean(axis=0)), f)
    found = identify(gantry_logs.robot(), near, fixed=NO_LINKS, friction="asymmetric", minimum_speed=0.001)
    assert "plate_mass" in found.weak
