"""The laws of lead-through against what they say: (8.1) to (8.11)."""

import numpy as np
import pytest

from gantrytau import Input, Model, ModelError, Samples, simulate
from gantrytau_models.leadthrough.laws import (
    ContactState,
    Impedance,
    NormalEstimate,
    Projection,
    ToolForceControl,
)
from gantrytau_models.leadthrough.lead_through import LeadThrough
from gantrytau_models.leadthrough.servo_and_sensors import VelocityServo

PERIOD = 0.004


def after(model, samples, **inputs):
    """Result of a block with inputs held from sample to sample; values just behind an instant are between two of them."""
    return simulate(model, stop=samples * PERIOD, points=2 * samples + 1, inputs=inputs)


def behind(result, name, k):
    """A variable in the middle between sample k and the next."""
    return result.at((k + 0.5) * PERIOD, name)


def held(rows):
    """Inputs that change a little before each instant, so that no jump meets one."""
    return Samples((np.arange(len(rows)) - 0.25) * PERIOD, np.array(rows, dtype=float), kind="constant")


def test_a_force_is_an_acceleration_after_one_sample():
    run = after(Impedance(M=[2.0, 4.0, 1.0]), 3, f=[3.0, 4.0, 0.0])
    assert np.allclose(behind(run, "v", 0), PERIOD * np.array([1.5, 1.0, 0.0]), rtol=1e-14)
    # nothing is passed on, so that it starts anew: no wind-up
    assert np.allclose(behind(run, "v", 2), PERIOD * np.array([1.5, 1.0, 0.0]), rtol=1e-14)


def test_without_anti_windup_velocity_adds_up():
    run = after(Impedance(anti_windup=False), 10, f=[0.0, 0.0, 3.0])
    assert np.isclose(behind(run, "v[2]", 9), 10 * PERIOD * 1.5, rtol=1e-12)


class Free(Model):
    """A tool that touches nothing, under a steady hand."""

    control = LeadThrough()
    arm = VelocityServo()

    def equations(self):
        yield self.control.f_h == [2.0, -1.0, 0.5]
        yield self.control.f_t == 0
        yield self.control.t_t == 0
        yield self.control.v_tool == self.arm.v
        yield self.arm.v_ref == self.control.v


@pytest.mark.parametrize("damping", [40.0, 450.0])  # of 500 N s/m, above which a sampled law swings with 2 kg
def test_the_hand_moves_the_tool_with_its_damping_alone_in_the_end(damping):
    run = after(Free(control=dict(hand=dict(D=[damping] * 3))), 800)
    assert np.allclose(behind(run, "arm.v", 799), np.array([2.0, -1.0, 0.5]) / damping, atol=1e-9)


@pytest.mark.parametrize("hand", [dict(D=[40.0, 40.0, 500.0]), dict(M=[1e-9] * 3), dict(D=[1e9] * 3)])
def test_damping_that_a_sampled_law_cannot_hold_is_refused(hand):
    with pytest.raises(ModelError, match="expected masses above period times damping; take a larger mass"):
        simulate(Free(control=dict(hand=hand)), stop=0.1)


def test_tool_force_is_driven_to_its_reference_along_the_normal():
    run = after(ToolForceControl(K_tau=[3.0] * 3), 1, f=[0.3, 0.0, 1.0], t=[0, 0.1, 0], n=[0, 0, 1])
    assert np.allclose(run["v"][0], 0.03 * np.array([-0.3, 0.0, 1.0]))
    assert np.allclose(run["w"][0], [0.0, -0.3, 0.0])


CONTACT = [  # force of the tool, pull of the hand -> contact
    (0.0, 0.0, 0),
    (0.4, 0.0, 0),  # not yet
    (0.6, 0.0, 1),
    (0.0, 0.0, 1),  # a lost force ends nothing
    (2.0, 7.9, 1),
    (2.0, 8.1, 0),  # released
    (2.0, 16.0, 0),  # the force is still there
    (2.0, 0.0, 0),
    (0.3, 0.0, 0),
    (0.1, 0.0, 0),  # armed again
    (0.6, 0.0, 1),
]


def contacts(**modifications):
    f_n, pull, _ = zip(*CONTACT, strict=True)
    run = after(ContactState(**modifications), len(CONTACT), f_n=held(f_n), pull=held(pull))
    return [round(behind(run, "touched", k)) for k in range(len(CONTACT))]


def test_contact_begins_ends_and_is_armed_again():
    assert contacts() == [state for *_, state in CONTACT]


def test_without_being_armed_contact_comes_back_at_once():
    assert contacts(rearm=1e9)[6] == 1


@pytest.mark.parametrize("noise", [0.0, 0.15])
def test_contact_is_lost_after_a_while_without_force(noise):
    begin, gone = 2, 30
    force = np.where(np.arange(200) < gone, 2.0, 0.1)
    force[gone:] += noise * np.random.default_rng(1).standard_normal(200 - gone)
    force[:begin] = 0.0
    run = after(ContactState(patience=0.1), 200, f_n=held(force), pull=0.0)
    state = [round(behind(run, "touched", k)) for k in range(200)]
    assert state[begin : gone + 25] == [1] * (gone + 25 - begin)  # 25 samples are 0.1 s
    end = state.index(0, begin)
    assert end == gone + 25 if not noise else gone + 25 < end < gone + 75
    assert not any(state[end : end + 5])


def test_short_losses_end_no_contact():
    force = np.tile([2.0, 0.0, 0.0, 0.0, 2.0, 2.0, 2.0], 40)  # bouncing on a plate
    run = after(ContactState(patience=0.02), len(force), f_n=held(force), pull=0.0)
    assert all(round(behind(run, "touched", k)) for k in range(2, len(force)))


def test_a_tool_that_lost_the_surface_does_not_go_on_into_the_void():
    class OverTheEdge(Model):
        control = LeadThrough()
        f = Input(3, unit="N")

        def equations(self):
            yield self.control.f_h == 0
            yield self.control.f_t == self.f
            yield self.control.t_t == 0
            yield self.control.v_tool == 0

    force = np.zeros((200, 3))
    force[1:50, 2] = 2.0
    run = after(OverTheEdge(), 200, f=held(force))
    assert np.isclose(behind(run, "control.v[2]", 60), 0.03 * 2.0)  # K f_ref, it seeks
    assert np.all([behind(run, "control.v", k) == 0 for k in range(50 + 64, 200)])


@pytest.mark.parametrize(
    ("degrees", "gate", "passed"),
    [(9.9, 10, 1), (10.1, 10, 0), (0.0, 0, 1), (0.1, 0, 0), (90.0, 180, 1), (180.0, 180, 1), (180.0, 179, 0)],
)
def test_normals_are_believed_within_the_gate(degrees, gate, passed):
    f = 3 * np.array([np.sin(np.deg2rad(degrees)), 0.0, np.cos(np.deg2rad(degrees))])
    run = after(NormalEstimate(gate=np.deg2rad(gate)), 1, f=f)
    assert run["passed"][0] == passed
    assert np.allclose(run["n"][0], f / 3 if passed else [0, 0, 1], atol=1e-12)


def test_a_force_that_is_nothing_has_no_direction():
    run = after(NormalEstimate(gate=np.pi), 1, f=[0.0, 0.0, 0.0])
    assert np.array_equal(run["n"][0], [0, 0, 1])
    assert np.array_equal(after(NormalEstimate(gate=np.pi), 1, f=[0.049, 0, 0])["n"][0], [0, 0, 1])


def test_hand_and_tool_share_the_directions():
    n, v_h, v_t = np.array([0.6, 0.0, 0.8]), np.array([0.1, 0.05, -0.02]), np.array([0.01, 0.02, 0.03])
    given = dict(n=n, v_h=v_h, v_t=v_t, w_t=[1.0, 2.0, 3.0])
    free, touching = (after(Projection(v_max=10.0), 1, contact=c, **given) for c in (0.0, 1.0))
    assert np.allclose(free["p_h"][0], v_h)
    assert not np.any(free["p_t"][0])
    assert not np.any(free["w"][0])
    assert np.allclose(touching["p_h"][0], v_h - (n @ v_h) * n)
    assert np.allclose(touching["p_t"][0], (n @ v_t) * n)
    assert np.allclose(touching["w"][0], [1, 2, 3])


def test_the_hand_has_a_largest_speed():
    run = after(Projection(), 1, n=[0, 0, 1], v_h=[3.0, 4.0, 0.0], v_t=[0, 0, 0], w_t=[0, 0, 0])
    assert np.allclose(run["p_h"][0], [0.15, 0.2, 0.0])
