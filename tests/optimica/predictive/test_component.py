"""An `Mpc` as a component of models that `simulate` runs."""

import numpy as np
import pytest

from gantrytau import Input, Model, ModelError, Parameter, Real, connect, der, linearize, simulate, translate
from gantrytau.blocks import SampleHold
from gantrytau.language.events import by_law
from gantrytau_fmu import export_fmu
from gantrytau_optimica import Mpc, Optimization

PERIOD = 0.1  # s


class Sledge(Model):
    """A mass that a force moves: between samples its path is a parabola, which both integrators have exactly."""

    m = Parameter(2.0, unit="kg")
    s, v = Real(unit="m", start=1.0, fixed=True), Real(unit="m/s", start=0.0, fixed=True)
    f = Input(unit="N", min=-1.0, max=1.0)

    def equations(self):
        yield der(self.s) == self.v
        yield self.m * der(self.v) == self.f


class There(Optimization):
    """To a place, which may be given from outside."""

    sledge = Sledge()
    place = Parameter(0.0, unit="m")

    def integrand(self):
        return (self.sledge.s - self.place) ** 2 + 0.1 * self.sledge.f**2


def controller(**keywords):
    return Mpc(There, period=PERIOD, elements=10, **keywords)


def in_a_model(mpc):
    class Loop(Model):
        sledge, mpc_ = Sledge(), mpc.component()

        def equations(self):
            yield from self.mpc_.wired(sledge=self.sledge)

    return Loop


def behind(result, name, count):
    """Values just behind the first samples."""
    return result.at(PERIOD * np.arange(count) + 1e-6, name)


@pytest.mark.parametrize("delay", [0, 1])
def test_inputs_are_those_of_a_run(delay):
    mpc = controller(delay=delay)
    loop, kind = mpc.run(stop=1.0), in_a_model(mpc)
    for found in (simulate(kind(), stop=1.0, tolerance=1e-10) for _ in range(2)):  # the second begins anew
        np.testing.assert_allclose(behind(found, "sledge.f", 10), loop["sledge.f"][:10], atol=1e-9)
        assert found["mpc_.step"][-1] == 11
        assert not found["mpc_.status"].any()


def test_others_that_sample_beside_it_change_nothing():
    mpc = controller()
    (one, two), starts = (mpc.component() for _ in range(2)), (1.0, 0.5)

    class Two(Model):
        first, second = Sledge(), Sledge(s=dict(start=starts[1]))
        a, b = one, two
        quick = SampleHold(period=PERIOD / 4)

        def equations(self):
            for sledge, its in ((self.first, self.a), (self.second, self.b)):
                yield connect(sledge.s, its.s)
                yield connect(sledge.v, its.v)
                yield connect(its["sledge.f"], sledge.f)
            yield connect(self.first.s, self.quick.u)

    found = simulate(Two(), stop=1.0, tolerance=1e-10)
    for name, start in zip(("first", "second"), starts, strict=True):
        loop = mpc.run(stop=1.0, start={"sledge.s": start})
        np.testing.assert_allclose(behind(found, f"{name}.f", 10), loop["sledge.f"][:10], atol=1e-9)


def test_a_reference_is_an_input():
    mpc = controller(parameters=["place"])

    class Led(in_a_model(mpc)):
        def equations(self):
            yield from super().equations()
            yield self.mpc_.place == 0.3

    found = simulate(Led(), stop=1.0, tolerance=1e-10)
    loop = Mpc(There(place=0.3), period=PERIOD, elements=10).run(stop=1.0)
    np.testing.assert_allclose(behind(found, "sledge.f", 10), loop["sledge.f"][:10], atol=1e-9)


@pytest.mark.parametrize(
    "what",
    [
        translate,
        lambda model: linearize(model, inputs=()),
        lambda model: export_fmu(model, "loop.fmu"),
        lambda model: translate(model, events=True).equations("base-modelica"),
    ],
)
def test_what_needs_formulas_is_told(what):
    with pytest.raises(
        ModelError, match=r"mpc_ \(ThereMpc\).*function of Python.*expected formulas.*leave it out"
    ):
        what(in_a_model(controller())())


def test_ports_that_are_none_are_told():
    mpc = controller()

    class Elsewhere(in_a_model(mpc)):
        def equations(self):
            yield from self.mpc_.wired(slide=self.sledge)

    with pytest.raises(ModelError, match=r"no sledge\.s among slide; give sledge=component"):
        simulate(Elsewhere(), stop=1.0)
    with pytest.raises(ModelError, match=r"no port for 'sledge\.w', expected one of sledge\.s"):
        mpc.component()["sledge.w"]


def test_a_law_sets_what_is_sampled():
    class Unsampled(Model):
        x = Real()

        def equations(self):
            yield by_law([self.x], lambda t, given: [t], [])

    with pytest.raises(ModelError, match=r"found x in by_law, expected sampled scalars; sample it"):
        translate(Unsampled(), events=True)
