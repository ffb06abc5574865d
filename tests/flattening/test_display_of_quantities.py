"""Declarations that say how they are shown, and values that bring their unit, from the class body to the result."""

from typing import Any

import matplotlib
import numpy as np
import pytest

from gantrytau import (
    Array,
    Discrete,
    Fixed,
    Input,
    Model,
    ModelError,
    Parameter,
    Real,
    Samples,
    Start,
    der,
    flatten,
    linearize,
    simulate,
    study,
    translate,
    with_setting,
)

matplotlib.use("Agg")


class Swing(Model):
    """A pendulum that counts nothing."""

    L = Parameter("700 mm", unit="m", display="mm", description="length")
    g = Parameter(9.81, unit="m/s2", description="gravity")
    phi = Real(unit="rad", display="deg", description="angle", start="90 deg", fixed=True)
    w = Real(unit="rad/s", display="rpm", description="angular velocity", start=0.0, fixed=True)
    r = Real(2, unit="m", display="mm", description="place of the tip")
    R = Real((2, 2), unit="1", display="%", description="orientation")
    turn = Real(unit="rad", description="the same angle under another name")
    push = Input(unit="1/s2", start=0.0, description="what drives it")
    rounds = Discrete(0, unit="1", display="%", description="full turns")

    def equations(self):
        from gantrytau import cos, pre, sin, when

        yield self.w == der(self.phi)
        yield der(self.w) == -self.g / self.L * sin(self.phi) + self.push
        yield self.r[0] == self.L * sin(self.phi)
        yield self.r[1] == -self.L * cos(self.phi)
        yield self.R[0, 0] == cos(self.phi)
        yield self.R[0, 1] == -sin(self.phi)
        yield self.R[1, 0] == sin(self.phi)
        yield self.R[1, 1] == cos(self.phi)
        yield self.turn == self.phi
        yield when(self.phi > 6.28, self.rounds == pre(self.rounds) + 1)


class Pair(Model):
    """Two of them."""

    swings = Array(Swing, 2, L=0.5)


def test_values_with_units_are_si_inside():
    run = simulate(Swing(), stop=0.1, inputs={"push": 0.0})
    assert run["L"][0] == 0.7
    assert run["phi"][0] == np.pi / 2
    same = simulate(Swing(L=0.7, phi=Fixed(np.pi / 2)), stop=0.1)
    assert np.array_equal(run["phi"], same["phi"])


def test_displays_reach_elements_derivatives_and_arrays_of_components():
    run = simulate(Swing(), stop=0.1)
    shown = {
        n: run.display(n) for n in ("phi", "der(phi)", "w", "der(w)", "r", "r[1]", "R[0,1]", "rounds", "turn")
    }
    assert shown == {
        "phi": "deg", "der(phi)": "deg/s", "w": "rpm", "der(w)": "rpm/s", "r": "mm", "r[1]": "mm", "R[0,1]": "%",
        "rounds": "%", "turn": "",
    }  # fmt: skip
    assert (run.unit("der(phi)"), run.unit("der(w)")) == ("rad/s", "rad/s2")
    both = simulate(Pair(), stop=0.1)
    assert both.display("swings[1].phi") == "deg"
    axis = both.plot("swings[1].phi", "swings[0].turn").axes[0]
    assert axis.get_ylabel() == "swings[1].phi [deg]"
    assert np.asarray(axis.lines[0].get_ydata())[0] == 90.0


class Slow(Swing):
    """A heavier one, whose author likes turns."""

    phi = Real(unit="rad", display="rev", description="angle", start=0.5, fixed=True)


class Holder(Model):
    """One whose display is a modification."""

    swing = Swing(phi=dict(display="rad"), w=dict(display="deg/s"))


def test_subclasses_and_modifications_show_it_otherwise():
    assert flatten(Slow()).vectors["phi"].display == "rev"
    held = flatten(Holder())
    assert (held.vectors["swing.phi"].display, held.vectors["swing.w"].display) == ("rad", "deg/s")
    assert flatten(Holder(swing=dict(phi=dict(display="mrad")))).vectors["swing.phi"].display == "mrad"


def declared(**keywords: Any) -> Model:
    """A model with one quantity."""

    class One(Model):
        """One quantity."""

        x = Real(**keywords)

        def equations(self):
            yield self.x == 0

    class Two(Model):
        """What holds it."""

        part = One()

    return Two()


DECLARED = [  # declarations, and what is said of their values
    (
        dict(unit="m", display="deg"),
        "^part.x: display: found 'deg', an angle, expected a length in m; write 'm', 'mm'",
    ),
    (dict(unit="Pa", display="dB"), "part.x: display: unit 'dB': dB is logarithmic"),
    (dict(display="mm"), "part.x: display: found 'mm' for what has no unit, expected none"),
    (dict(unit="m", display=3), "part.x: display: found 3, expected a unit as text"),
    (dict(unit="deg"), "'deg' is not a coherent SI unit; .* say how to show it: unit='rad', display='deg'"),
    (dict(unit="m", start="3 s"), "^part.x: start: found '3 s', a time, expected a length in m"),
    (dict(unit="m", max="3"), "^part.x: max: found '3' in quotes and without a unit"),
    (dict(unit="K", start="-300 degC"), "^part.x: start: found -300 degC, expected at least -273.15"),
]


@pytest.mark.parametrize(("keywords", "message"), DECLARED)
def test_what_cannot_be_shown_or_begun_like_that(keywords, message):
    with pytest.raises(ModelError, match=message):
        translate(declared(**keywords))


def test_settings_starts_parameters_inputs_and_points_take_texts():
    changed = with_setting(with_setting(Swing(), "L", "20 in"), "phi.start", "45 deg")
    assert simulate(changed, stop=0.01)["L"][0] == 0.508
    dae = translate(Swing(phi=Start("10 deg")), events=True)
    run = simulate(
        dae, stop=0.01, parameters={"L": "300 mm"}, starts={"phi": "45 deg"}, inputs={"push": "60 1/min2"}
    )
    assert (run["L"][0], run["phi"][0], run["push"][0]) == (0.3, np.pi / 4, 60 / 3600)  # fmt: skip


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        (dict(parameters={"L": "700 deg"}), "parameters: L: found '700 deg', an angle, expected a length in"),
        (dict(starts={"phi": "700 mm"}), "starts: phi: found '700 mm', a length, expected an angle in rad"),
        (dict(inputs={"push": "5 N"}), "input push: found '5 N', a force, expected a value in 1/s2"),
        (dict(inputs={"push": Samples([0, 1], [0, 1], unit="N")}), "input push: found 'm.kg/s2', a force"),
    ],
)
def test_texts_of_another_kind_are_refused_with_their_place(keywords: Any, message):
    with pytest.raises(ModelError, match=message):
        simulate(Swing(), stop=0.1, **keywords)


def test_samples_may_have_a_unit():
    given = Samples([0, 1], [0.0, 3600.0], unit="1/min2", deviation=360.0)
    run = simulate(Swing(), stop=1.0, inputs={"push": given})
    assert run.final("push") == 1.0
    with pytest.raises(ModelError, match="Samples: unit 'foo': there is no unit 'foo'"):
        Samples([0, 1], [0, 1], unit="foo")


def test_a_point_of_linearisation_may_be_in_degrees():
    class Still(Swing):
        """Without what counts."""

        def equations(self):
            yield self.w == der(self.phi)
            yield der(self.w) == -self.g / self.L * self.phi + self.push

        r = None
        R = None
        turn = None
        rounds = None

    about = linearize(Still(), at={"phi": "30 deg", "w": "2 rpm"})
    assert about.point["phi"] == pytest.approx(np.pi / 6, rel=1e-15)
    assert about.point["w"] == pytest.approx(np.pi / 15, rel=1e-15)


def test_studies_vary_values_with_units():
    found = study(
        Swing(), over={"L": ["500 mm", "1 m"], "phi": ["10 deg", "20 deg"]}, stop=0.1, outputs=["phi"]
    )
    assert not found.failures
    table = found.to_xarray()
    assert table["L"].values.tolist() == [0.5, 1.0]
    assert table["phi.start"].values.tolist() == [np.radians(10), np.radians(20)]
    axis = found.plot("phi").axes[0]
    assert axis.get_ylabel() == "phi [deg]"
    legend = axis.get_legend()
    assert legend is not None
    labels = [text.get_text() for text in legend.get_texts()]
    assert labels[:2] == ["L=0.5, phi=10 deg", "L=0.5, phi=20 deg"]
    assert found.plot("phi", display="rev").axes[0].get_ylabel() == "phi [rev]"
    with pytest.raises(ModelError, match="parameters: L: found '1 s', a time"):
        study(Swing(), over={"L": ["500 mm", "1 s"]}, stop=0.1)
    with pytest.raises(ModelError, match="study: over: phi: found '1 s', a time"):
        study(Swing(), over={"phi": ["1 s"]}, stop=0.1)


def test_texts_of_vectors_have_their_shape():
    class Plate(Model):
        """Places on a plate."""

        r = Parameter("[1, 2, 3] mm", unit="m", description="place")
        holes = Parameter(unit="m", description="places of two holes")

        def equations(self):
            yield from ()

    flat = flatten(Plate(holes="[[1, 2], [3, 4]] mm"))
    assert (flat.shape("r"), flat.shape("holes")) == ((3,), (2, 2))
    assert [float(x) for x in flat.vectors["r"].value] == [0.001, 0.002, 0.003]  # pyright: ignore[reportAttributeAccessIssue]
