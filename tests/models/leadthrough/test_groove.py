"""A tool led along a groove: forces of two walls, statics of the loop, and what the projection of one surface does there."""

import numpy as np
import pytest

from gantrytau import ModelError, simulate, translate
from gantrytau_models.leadthrough import LeadThrough, ToolInGroove

K, D, HELD = 0.03, 40.0, 2.0  # of the controller: m/(s.N), N.s/m, N
STIFFNESS = 2000.0


def led(stop=2.0, control=None, turn=0.0, **groove):
    """A hand that pushes with 1 N along and 1 N across, from where the walls bear 2 N."""
    wall = groove.get("wall", np.pi / 4)
    start = [0.0, 0.0, HELD / (2 * STIFFNESS * np.sin(wall) ** 2)]
    more = {} if control is None else dict(control=control)
    model = ToolInGroove(groove=dict(turn=turn, **groove), arm=dict(r=dict(start=start)), **more)
    return simulate(model, stop=stop, inputs={"f_h[0]": 1.0, "f_h[1]": 1.0})


def test_walls_are_two_springs():
    dae = translate(ToolInGroove(groove=dict(wall=0.6)), events=True)
    y, z = 1e-4, 1e-3  # within both walls: what they do along and across is apart
    at = dae.evaluate({"arm.r": [0.3, y, z]})
    wanted = 2 * STIFFNESS * np.array([0.0, y * np.cos(0.6) ** 2, z * np.sin(0.6) ** 2])
    np.testing.assert_allclose(at["groove.f"], wanted, rtol=1e-12)
    at = dae.evaluate({"arm.r": [0.0, 2e-3, 0.0]})  # one wall alone
    push = STIFFNESS * 2e-3 * np.cos(0.6)
    np.testing.assert_allclose(at["groove.f"], push * np.array([0.0, np.cos(0.6), np.sin(0.6)]), rtol=1e-12)
    assert not np.any(dae.evaluate({"arm.r": [0.0, 0.0, -1e-3]})["groove.f"])


@pytest.mark.parametrize("turn", [0.0, 0.05])
def test_the_hand_moves_along_and_the_force_is_held_across(turn):
    """A groove that is turned against what is known of it leads the tool sideways, for which it has to press: v_y / K."""
    found = led(turn=turn)
    speed = 1.0 / D
    np.testing.assert_allclose(found.final("arm.v"), speed * np.array([1.0, np.tan(turn), 0.0]), atol=1e-6)
    np.testing.assert_allclose(
        found.final("groove.f")[1:], [-speed * np.tan(turn) / K, HELD], atol=1e-5
    )  # the hand pushes by 1 N across, and is not heard


def test_the_projection_of_one_surface_lets_the_hand_drive_the_tool_up_a_wall():
    found = led(control=LeadThrough())
    assert abs(found.final("arm.r[1]")) > 0.01
    assert abs(led().final("arm.r[1]")) < 1e-8


def test_a_direction_is_of_length_one():
    control = dict(projection=dict(along=[1.0, 1.0, 0.0]))
    with pytest.raises(ModelError, match="length one"):
        simulate(ToolInGroove(control=control), stop=0.1)
