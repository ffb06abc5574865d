"""`Mpc` in a loop whose measurements are wrong, and from starts everywhere: it keeps its limits."""

from collections import Counter

import numpy as np
import pytest

from gantrytau import Input, Model, Parameter, Real, between, cos, der, sin
from gantrytau_optimica import Mpc, Optimization
from tests.optimica.predictive.test_mpc import Upright

SWAY, RAIL = 0.1, 6.0  # rad, m
COUNT = 100  # starts; 1,000 take two minutes


class Crane(Model):
    """A trolley with a load on a rope, in bare numbers."""

    length = Parameter(3.0)
    s, v, phi, w = Real(start=1.0), Real(start=0.0), Real(start=0.0), Real(start=0.0)
    a = Input(min=-0.5, max=0.5)

    def equations(self):
        yield der(self.s) == self.v
        yield der(self.v) == self.a
        yield der(self.phi) == self.w
        yield self.length * der(self.w) == -self.a * cos(self.phi) - 9.81 * sin(self.phi)


class Still(Optimization):
    """The load hangs still in the middle of the rail."""

    crane = Crane()

    def integrand(self):
        o = self.crane
        return o.s**2 + 0.5 * o.v**2 + 10 * o.phi**2 + 10 * o.w**2 + 0.1 * o.a**2

    def constraints(self):
        yield between(-SWAY, self.crane.phi, SWAY)
        yield between(-RAIL, self.crane.s, RAIL)


def wrong(measured, rng, before):
    """A measurement as sensors and lines spoil it: lost in part or whole, infinite, far away, or an old one."""
    name, whole = rng.choice(list(measured)), rng.integers(8)
    if whole == 0:
        return dict.fromkeys(measured, np.nan)
    if whole == 1:
        return before
    spoilt = {2: np.nan, 3: np.inf, 4: rng.normal() * 10.0 ** rng.integers(0, 9)}
    return measured | {name: spoilt.get(int(whole), measured[name])}


@pytest.mark.parametrize(
    ("problem", "keywords"), [(Upright, {}), (Upright, {"delay": 1}), (Still, {"hard": "all"})]
)
def test_wrong_measurements_never_give_inputs_beyond_their_limits(problem, keywords):
    mpc, rng, told = Mpc(problem, period=0.05, elements=15, **keywords), np.random.default_rng(3), Counter()
    stages = mpc.stages
    x = np.array([s.guess(np.zeros(1))[0] for s in stages.phase.states]) / stages.sizes_x
    before = measured = dict(zip(mpc.states, (x * stages.sizes_x).tolist(), strict=True))
    for k in range(150):
        late = rng.uniform(-0.02, 0.02) if k % 7 == 3 else 0.0
        (u,) = mpc.step(wrong(measured, rng, before) if k else measured, 0.05 * k + late).values()
        told[mpc.status] += 1
        assert stages.lower_u[0] <= u / stages.sizes_u[0] <= stages.upper_u[0]
        if k % 3:
            mpc.prepare()
        x = stages.moved(x, np.tile(x, 2), np.array([u]) / stages.sizes_u, 0.05 * k)[stages.last]
        before, measured = measured, dict(zip(mpc.states, (x * stages.sizes_x).tolist(), strict=True))
    assert told["solved"] > 50
    assert told["lost"] > 10


def test_a_plan_that_a_wrong_measurement_has_spoilt_is_made_anew():
    mpc = Mpc(Upright, period=0.05, elements=15)
    state = {"pole.p": 0.3, "pole.th": 0.2, "pole.v": 0.0, "pole.w": 0.0}
    expected, t = mpc.step(state)["pole.f"], 0.0
    for wild in (10.0, 1e4, 1e150, 1e300):
        given = [mpc.step(one, t := t + 0.05)["pole.f"] for one in (state | {"pole.w": wild}, *[state] * 2)]
        assert given[-1] == pytest.approx(expected, rel=0.01)
        assert mpc.status == "solved"


def test_cranes_from_all_starts_keep_their_limits():
    mpc, rng = Mpc(Still, period=0.1, elements=40), np.random.default_rng(11)
    names = ("crane.s", "crane.v", "crane.phi", "crane.w")
    for _ in range(COUNT):
        start = rng.uniform(-1.0, 1.0, 4) * [5.0, 0.4, 0.6 * SWAY, 0.05]
        loop = mpc.run(stop=2.0, start=dict(zip(names, start.tolist(), strict=True)))
        assert set(loop.statuses) == {"solved"}
        assert np.abs(loop["crane.a"]).max() <= 0.5
        assert np.abs(loop["crane.s"]).max() <= RAIL
        assert (
            np.abs(loop["crane.phi"]).max() <= SWAY + 1e-4
        )  # what integration in four steps a period differs by
