"""A screw that swings a lever: the law of cosines, power, energy, dead centres, and the same in numbers."""

import dataclasses
import math

import numpy as np
import pytest

from gantrytau import Array, Fixed, Model, ModelError, simulate, sin, translate
from gantrytau.kinematics import TurntableScrew
from gantrytau.mechanics import gears, rotational
from gantrytau_models import F1GantryTau, prototypes
from tests.mechanisms.rows import in_a_row, row

TOLERANCE = 1e-10
SCREW = TurntableScrew(base=0.3, crank=0.12, angle=1.2, lead=0.005)


class Table(Model):
    """A motor turns a spindle, which swings a table."""

    motor = rotational.Torque()
    spindle, table = rotational.Inertia(J=2e-5), rotational.Inertia(J=0.8, phi=Fixed(0.2), w=Fixed(0.0))
    screw = gears.ScrewLever(**dataclasses.asdict(SCREW))

    def equations(self):
        yield from row(self.motor, self.spindle, self.screw, self.table)


@pytest.fixture(scope="module")
def swinging():
    return simulate(Table(), stop=1.0, inputs={"motor.tau": lambda t: 0.02 * sin(9 * t)}, tolerance=TOLERANCE)


def test_the_component_is_the_map(swinging):
    phi = swinging["table.phi"]
    assert np.ptp(phi) > 0.05
    np.testing.assert_allclose(swinging["spindle.phi"], SCREW.motor(phi), rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(swinging["screw.length"], SCREW.length(phi), rtol=1e-12)
    np.testing.assert_allclose(swinging["screw.lever"], SCREW.lever(phi), rtol=1e-12)
    np.testing.assert_allclose(
        swinging["spindle.w"], SCREW.ratio(phi) * swinging["table.w"], rtol=1e-9, atol=1e-9
    )


def test_power_that_enters_leaves(swinging):
    enters = swinging["screw.flange_a.tau"] * swinging["spindle.w"]
    leaves = swinging["screw.flange_b.tau"] * swinging["table.w"]
    assert np.ptp(enters) > 0.1  # W
    np.testing.assert_allclose(leaves, -enters, atol=1e-11 * np.ptp(enters))


def test_the_motor_does_the_work_of_both_inertias(swinging):
    energy = 0.5 * 2e-5 * swinging["spindle.w"] ** 2 + 0.5 * 0.8 * swinging["table.w"] ** 2
    power = swinging["motor.tau"] * swinging["spindle.w"]
    work = np.concatenate([[0.0], np.cumsum((power[1:] + power[:-1]) / 2 * np.diff(swinging.time))])
    # the trapezoidal rule over 500 intervals
    np.testing.assert_allclose(energy, work, atol=2e-4 * energy.max())


def test_a_motor_that_leads_tells_the_angle_of_the_table():
    Led = in_a_row(
        "Led",
        motor=rotational.Position(),
        screw=gears.ScrewLever(**dataclasses.asdict(SCREW)),
        load=rotational.Torque(),
    )

    dae = translate(Led())
    for theta in (-40.0, 0.0, 3.0, 55.0):
        at = dae.evaluate({"motor.phi": theta, "load.tau": -30.0})
        phi = float(SCREW.turntable(theta))
        assert at["screw.flange_b.phi"] == pytest.approx(phi, abs=1e-12)
        # 30 N.m on the table are a thousandth of that on the motor
        assert at["motor.tau"] == pytest.approx(30.0 / SCREW.ratio(phi), rel=1e-10)


def test_turntables_of_an_f1_on_screws():
    screws = [SCREW, dataclasses.replace(SCREW, angle=-1.4), dataclasses.replace(SCREW, lead=-0.004)]
    settings = [dataclasses.asdict(screw) for screw in screws]

    class Screwed(F1GantryTau):
        """Spindles turn the turntables; what the turntables' own motors do is zero."""

        screws = Array(gears.ScrewLever, settings)
        spindles = Array(rotational.Inertia, 3, J=2e-5)

        def equations(self):
            yield from super().equations()
            for screw, spindle, table in zip(self.screws, self.spindles, self.turntables, strict=True):
                yield from row(spindle, screw, table.joint.axis)

    at = translate(Screwed(prototypes.F1)).evaluate({f"turntables[{k}].phi": 0.1 * (k + 1) for k in range(3)})
    for k, screw in enumerate(screws):
        phi = float(at[f"turntables[{k}].phi"])
        assert phi == pytest.approx(0.1 * (k + 1), abs=1e-9)
        assert at[f"spindles[{k}].phi"] == pytest.approx(float(screw.motor(phi)), rel=1e-9)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (dict(base=0.0), "base.*expected a distance above zero"),
        (dict(crank=0.0), "crank.*expected a distance above zero"),
        (dict(angle=0.0), "angle.*expected an angle between 0 and pi"),
        (dict(angle=math.pi), "angle.*expected an angle between 0 and pi"),
    ],
)
def test_what_makes_no_screw_is_refused(values, message):
    with pytest.raises(ModelError, match=message):
        translate(Table(screw=gears.ScrewLever(**values)))
