"""Friction per direction, after Stribeck and after Dahl: forces against the printed laws, losses against closed forms."""

import numpy as np
import pytest

from gantrytau import Fixed, Model, ModelError, Real, connect, der, linearize, simulate, sin, translate
from gantrytau.mechanics import rotational, translational
from tests.mechanisms.rows import in_a_row

TOLERANCE = 1e-9
KINDS = {translational: ("s", "v", "f"), rotational: ("phi", "w", "tau")}
both = pytest.mark.parametrize("kind", KINDS, ids=["translation", "rotation"])


def law(kind, name, **parameters):
    """A friction with its parameters by their letters in translation: f_c, f_v, f_s, v_s, v_stribeck."""
    _, v, f = KINDS[kind]
    own = {
        key if key[0] not in "fv" else {"f": f, "v": v}[key[0]] + key[1:]: x for key, x in parameters.items()
    }
    return getattr(kind, name)(**own)


def moved(kind, friction):
    """A flange that is moved as a function of time against friction, whose work is summed up."""
    s, v, f = KINDS[kind]

    class Moved(Model):
        """A given motion against friction."""

        motion = kind.Position()
        law = friction
        work = Real(unit="J", description="work against friction", start=0.0, fixed=True)

        def equations(self):
            yield connect(self.motion.flange, self.law.flange)
            yield der(self.work) == getattr(self.law, f) * getattr(self.law, v)

    return Moved(), f"motion.{s}", f"law.{v}", f"law.{f}"


def forces(kind, friction, speeds):
    """The force at some speeds."""
    model, s, _, f = moved(kind, friction)
    function = translate(model).function([f"der({s})"], [f])
    return np.array(function(np.array(speeds)[None])).ravel()


@both
def test_each_direction_has_its_own_friction(kind):
    friction = law(kind, "AsymmetricFriction", f_c=(6.0, 4.0), f_v=(3.0, 1.0), v_s=0.01)
    found = forces(kind, friction, [2.0, -2.0, 0.0, 0.5, -0.5])
    assert found == pytest.approx([12.0, -6.0, 0.0, 7.5, -4.5], rel=1e-14, abs=0)  # tanh(50) is 1 to rounding
    slow = np.linspace(-0.05, 0.05, 101)
    for pair in ((6.0, 4.0), (6.0, 0.0), (0.0, 6.0)):
        found = forces(kind, law(kind, "AsymmetricFriction", f_c=pair, f_v=pair, v_s=0.01), slow)
        assert np.all(found * slow >= 0)  # never drives


@both
def test_equal_directions_are_the_friction_of_both(kind):
    speeds = np.linspace(-0.2, 0.2, 41)
    pairs = forces(kind, law(kind, "AsymmetricFriction", f_c=(5.0, 5.0), f_v=(2.0, 2.0)), speeds)
    assert pairs == pytest.approx(
        forces(kind, law(kind, "TanhFriction", f_c=5.0, f_v=2.0), speeds), rel=1e-14
    )


@both
@pytest.mark.parametrize("n", [0.5, 1.0, 2.0])
def test_friction_falls_from_static_to_coulomb(kind, n):
    friction = law(kind, "StribeckFriction", f_c=4.0, f_s=7.0, v_stribeck=0.2, n=n, f_v=3.0, v_s=1e-3)
    speeds = np.array([-3.0, -0.2, -0.05, 0.05, 0.2, 1.0])  # 50 smoothing speeds and more
    size = np.abs(speeds)
    expected = np.sign(speeds) * (4.0 + 3.0 * np.exp(-((size / 0.2) ** n)) + 3.0 * size)
    assert forces(kind, friction, speeds) == pytest.approx(expected, rel=1e-13)
    assert forces(kind, friction, [0.0]) == [0.0]
    model, s, _, f = moved(kind, friction)
    slopes = np.array(translate(model).function([f"der({s})"], [f]).jacobian()(0.0, 0.0))
    # at rest the slope is that of the smoothed sign
    assert slopes == pytest.approx((4.0 + 3.0 * np.exp(-((1e-3 / 0.2) ** n))) / 1e-3 + 3.0, rel=1e-12)


def test_a_slow_mass_on_falling_friction_is_unstable_and_a_fast_one_is_not():
    # A mass that is pulled over a floor through nothing but its own speed.
    Pulled = in_a_row(
        "Pulled",
        mass=translational.Mass(m=2.0),
        floor=translational.StribeckFriction(f_c=4.0, f_s=7.0, v_stribeck=0.2, f_v=1.0),
    )

    for speed, sign in ((0.1, 1.0), (2.0, -1.0)):
        rate = np.real(linearize(translate(Pulled()), at={"mass.v": speed}).poles)
        slope = 2 * speed / 0.2**2 * 3.0 * np.exp(-((speed / 0.2) ** 2)) - 1.0
        assert max(rate, key=abs) == pytest.approx(slope / 2.0, rel=1e-6)
        assert np.sign(max(rate, key=abs)) == sign


@both
@pytest.mark.parametrize("way", [1e-5, 1e-3, 0.1])
@pytest.mark.parametrize("rate", [1.0, 40.0])
def test_the_loop_of_dahl_has_its_area_at_any_rate(kind, way, rate):
    coulomb, stiffness = 4.0, 1e4
    model, s, _, f = moved(kind, law(kind, "DahlFriction", f_c=coulomb, sigma_0=stiffness))
    # the closed loop turns back at this deflection, and here it is entered there
    narrow = coulomb / stiffness
    area = 4 * coulomb * (way - narrow * np.tanh(way / narrow))
    model = type(model)(law=dict(z=Fixed(-narrow * np.tanh(way / narrow))), work=dict(nominal=area))
    turns, turn = 2, 2 * np.pi / rate
    run = simulate(
        model,
        stop=turns * turn,
        points=60 * turns + 1,
        tolerance=TOLERANCE,
        inputs={s: lambda t: -way * sin(rate * t + np.pi / 2)},
    )
    # to and fro lets 99 % of the work of short ways return
    assert run.final("work") - run.at((turns - 1) * turn, "work") == pytest.approx(area, rel=1e3 * TOLERANCE)
    assert np.abs(run[f]).max() <= coulomb * (1 + 1e4 * TOLERANCE)


@both
def test_dahl_yields_before_it_slides(kind):
    model, s, _, f = moved(kind, law(kind, "DahlFriction", f_c=4.0, sigma_0=1e4, f_v=2.0))
    run = simulate(model, stop=1.0, tolerance=TOLERANCE, inputs={s: lambda t: 2e-3 * t})
    way = 2e-3 * run.time
    np.testing.assert_allclose(run[f], 4.0 * -np.expm1(-1e4 * way / 4.0) + 2.0 * 2e-3, atol=1e3 * TOLERANCE)


@pytest.mark.parametrize(
    ("friction", "words"),
    [
        (translational.StribeckFriction(f_c=4.0, f_s=3.0), "static friction f_s of at least the Coulomb"),
        (rotational.StribeckFriction(tau_c=4.0, tau_s=3.0), "static friction tau_s of at least .* tau_c"),
        (translational.StribeckFriction(v_stribeck=0.0), "expected a Stribeck speed above zero"),
        (translational.DahlFriction(f_c=0.0), "Coulomb friction f_c above zero; take Frictionless for none"),
        (rotational.DahlFriction(tau_c=0.0), "Coulomb friction tau_c above zero; take Frictionless for none"),
        (translational.DahlFriction(sigma_0=0.0), "expected a stiffness sigma_0 above zero"),
        (translational.AsymmetricFriction(f_c=4.0), r"law.f_c: value has shape \(\), expected \(2,\)"),
    ],
)
def test_what_is_no_friction_is_refused(friction, words):
    kind = rotational if isinstance(friction, rotational.Friction) else translational
    with pytest.raises(ModelError, match=words):
        translate(moved(kind, friction)[0])
