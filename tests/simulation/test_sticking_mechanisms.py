"""Friction that sticks in several places at once, behind gears, in robots and in closed loops."""

import numpy as np
import pytest

from gantrytau import Array, Fixed, Model, Real, StructureError, connect, der, simulate, sin
from gantrytau.mechanics import gears, rotational, translational
from gantrytau.mechanics.translational import StickSlipFriction
from gantrytau_models import FourBar, GantryTau, prototypes
from tests.mechanisms.rows import row
from tests.references.sticking import Chain, M, Plank, shaken
from tests.simulation.test_sticking_motions import NEAR, TOLERANCE, lawful


@pytest.mark.parametrize("amplitude", [3.0, 6.0, 20.0, 100.0])
def test_several_stick_and_slip_and_energy_balances(amplitude):
    class Balanced(Chain):
        """With the work of the push, and what friction takes of it."""

        given = Real(unit="J", description="work of the push", start=0.0, fixed=True)
        lost = Real(unit="J", description="work against friction", start=0.0, fixed=True)

        def equations(self):
            yield from super().equations()
            yield der(self.given) == self.push.f * self.masses[0].v
            yield der(self.lost) == sum(floor.f * floor.v for floor in self.floors)

    rest = [dict(s=Fixed(0.0), v=Fixed(0.0))] * 3
    run = simulate(Balanced(masses=rest, amplitude=amplitude), stop=3.0, tolerance=TOLERANCE)
    kinetic = sum(run[f"masses[{k}].v"] ** 2 for k in range(3)) / 2
    elastic = sum(200.0 * run[f"springs[{k}].s_rel"] ** 2 for k in range(2)) / 2
    balance = kinetic + elastic + run["lost"] - run["given"]
    assert np.abs(balance).max() < NEAR * max(1.0, np.abs(run["given"]).max())
    for k, (coulomb, breakaway) in enumerate(((3.0, 4.0), (2.0, 5.0), (1.0, 1.5))):
        assert lawful(run, f"floors[{k}]", f"masses[{k}].v", coulomb, breakaway)
    moved = [np.any(run[f"floors[{k}].mode"]) for k in range(3)]
    assert moved == {3.0: [False] * 3}.get(amplitude, [True] * 3)


def test_twins_break_away_and_lock_together():
    class Twins(Model):
        """Two masses, each pushed alike."""

        masses = Array(translational.Mass, 2, m=M)
        floors = Array(StickSlipFriction, 2, f_c=6.0, f_s=9.0)
        pushes = Array(translational.Force, 2)

        def equations(self):
            for mass, floor, push in zip(self.masses, self.floors, self.pushes, strict=True):
                yield connect(mass.flange, floor.flange)
                yield connect(mass.flange, push.flange)

    rest = [dict(s=Fixed(0.0), v=Fixed(0.0))] * 2
    pushes = {f"pushes[{k}].f": lambda t: 10 * sin(8 * t) for k in range(2)}
    run = simulate(Twins(masses=rest), stop=1.0, tolerance=TOLERANCE, inputs=pushes)
    np.testing.assert_allclose(run["masses[0].s"], shaken(run.time), atol=NEAR)
    np.testing.assert_allclose(run["masses[1].s"], shaken(run.time), atol=NEAR)


def test_a_plank_carries_its_block_along_until_both_rest():
    """It slides under 4 N against 1 N, until both are equally fast; then the floor slows both, and they rest together."""
    run = simulate(Plank(), stop=5.0, tolerance=TOLERANCE)
    t = run.time
    joint = 2.0 / (3.0 + 4.0 / 3.0)  # both are equally fast: 3 t = 2 - 4/3 t
    rest = joint + 3.0 * joint / 0.25  # 1 N slows 4 kg
    expected = np.where(t < joint, 3.0 * t, np.clip(3.0 * joint - 0.25 * (t - joint), 0.0, None))
    assert rest > 5.0
    np.testing.assert_allclose(run["v_x"], expected, atol=NEAR)
    assert np.all(run["mode_above"][t < joint - NEAR] == 1)
    assert np.all(run["mode_above"][t > joint + NEAR] == 0)
    assert set(np.unique(run["mode_below"])) == {1.0}
    assert np.abs(run["slip"][run["mode_above"] == 0]).max() < 1e-15
    # what holds the block on the plank slows it as the floor slows both
    np.testing.assert_allclose(run["above"][run["mode_above"] == 0], 0.75, rtol=1e-12)


def test_a_geared_shaft_sticks_on_the_side_of_the_slide():
    class Geared(Model):
        """A motor drives a slide that sticks through a screw whose speed is no state."""

        rotor = rotational.Inertia(J=1e-3, phi=Fixed(0.0), w=Fixed(0.0))
        motor = rotational.Torque()
        screw = gears.BallScrew(lead=-0.01)
        slide = translational.Mass(m=50.0)
        rail = StickSlipFriction(f_c=100.0, f_s=150.0)

        def equations(self):
            yield from row(self.motor, self.rotor, self.screw, self.slide, self.rail)

    lead = 0.01 / (2 * np.pi)
    run = simulate(Geared(), stop=1.0, tolerance=TOLERANCE, inputs={"motor.tau": ([0.0, 1.0], [0.0, 0.5])})
    away = 150.0 * lead / 0.5
    inertia = 1e-3 + 50.0 * lead**2
    since = np.maximum(run.time - away, 0.0)
    w = (0.25 * (run.time**2 - away**2) - 100.0 * lead * since) / inertia
    np.testing.assert_allclose(run["rotor.w"], np.where(since > 0, w, 0.0), atol=1e-7)


def test_carts_of_the_robot_stick_and_slip():
    robot = GantryTau(prototypes.L1, friction=StickSlipFriction)
    hold = {f"carts[{k}].law.f_c": 200.0 for k in range(3)}
    run = simulate(robot, stop=1.0, parameters=hold)
    assert np.abs(run["tool.r"] - run["tool.r"][0]).max() < 1e-12
    run = simulate(
        robot, stop=1.0, inputs={f"carts[{k}].f": lambda t, k=k: 400.0 * sin(6 * t + k) for k in range(3)}
    )
    for k in range(3):
        mode, v = run[f"carts[{k}].law.mode"], run[f"carts[{k}].v"]
        assert {-1.0, 1.0} <= set(np.unique(mode))
        assert np.abs(v[mode == 0]).max(initial=0.0) < 1e-15
        law = prototypes.L1.coulomb[k] * mode + prototypes.L1.viscous[k] * v
        sliding = mode != 0
        np.testing.assert_allclose(run[f"carts[{k}].law.f"][sliding], law[sliding], atol=1e-9)
        most = np.array(prototypes.L1.coulomb)[k] + np.array(prototypes.L1.viscous)[k] * 5
        assert np.abs(run[f"carts[{k}].law.f"]).max() < most


class Linkage(FourBar):
    """A four-bar linkage with friction in the hinge of its rocker."""

    bearing = rotational.StickSlipFriction(tau_c=2.0, tau_s=3.0)

    def equations(self):
        yield from super().equations()
        yield connect(self.bearing.flange, self.rocker_pivot.axis)


def test_a_hinge_holds_a_closed_loop():
    run = simulate(Linkage(bearing=dict(tau_s=1e3)), stop=1.0, starts={"crank.w": 0.0})
    assert np.ptp(run["crank.phi"]) < 1e-12
    assert np.all(run["bearing.mode"] == 0)


def test_where_friction_has_no_hold_the_motion_goes_on():
    """The rocker rests for an instant where crank and coupler are in line, but no torque at it could stop the crank."""
    run = simulate(Linkage(), stop=2.0, starts={"crank.w": 0.0}, points=1001, tolerance=1e-9)
    mode, w = run["bearing.mode"], run["rocker.w"]
    assert {-1.0, 1.0} <= set(np.unique(mode))
    assert np.all(mode * w >= -1e-12)
    smooth = Linkage(bearing=rotational.TanhFriction(tau_c=2.0, w_s=1e-4))
    expected = simulate(smooth, stop=2.0, starts={"crank.w": 0.0}, points=1001, tolerance=1e-9)
    # smoothing takes from the work of friction what is done below 1e-4 rad/s, some hundred times
    moving = run.time < 1.0
    shown = np.interp(expected.time, run.time, run["crank.phi"])
    np.testing.assert_allclose(
        shown[expected.time < 1.0], expected["crank.phi"][expected.time < 1.0], atol=1e-3
    )
    assert np.any(np.diff(np.sign(w[moving & (w != 0)])))


def test_two_frictions_that_share_one_motion_are_named():
    class Both(Model):
        """One mass on two floors."""

        mass = translational.Mass(m=2.0)
        left, right = StickSlipFriction(f_c=4.0), StickSlipFriction(f_c=5.0)

        def equations(self):
            yield connect(self.mass.flange, self.left.flange)
            yield connect(self.mass.flange, self.right.flange)

    with pytest.raises(StructureError, match="one friction for each motion"):
        simulate(Both(), stop=1.0)
