"""Kinematics from outside, with their status, and the limits behind them."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from gantrytau import ModelError, SolveError
from gantrytau.kinematics import Kinematics
from gantrytau_fmu import Channel, PythonComponent
from gantrytau_fmu.controller import AxisLimits, Controller, ExternalKinematics
from gantrytau_models import GantryTau, prototypes
from tests.fmu.controller.conftest import slide

STOP = 0.2
THREE: Any = 3
POSE = (Channel("r_ref", "m", 2),)


def turned(angle):
    """Axes turned by an angle in the plane; out of reach beyond 1 m."""
    c, s = math.cos(angle), math.sin(angle)

    def axes(pose):
        return np.array([[c, s], [-s, c]]) @ pose, "beyond 1 m" if np.hypot(*pose) > 1 else ""

    return ExternalKinematics(axes, POSE, ["q_ref"])


def two_axes():
    return slide(Channel("q_ref", "m", 2))


def test_a_pose_becomes_axes_and_one_out_of_reach_leaves_them_where_they_are():
    law = lambda t, v: {"r_ref": [5.0, 0.0] if 0.1 <= t < 0.12 else [0.3, 0.4]}  # noqa: E731
    found = Controller(two_axes(), law, kinematics=turned(0.5), references={"r_ref": [0.0, 0.0]}).run(STOP)
    applied = found["applied.q_ref"]
    assert np.allclose(np.hypot(*applied.T), 0.5, rtol=1e-15)  # a turn keeps lengths
    assert found.timing.unreachable == 5
    assert found["r_ref"].shape == (51, 2)


def test_the_robot_goes_by_its_own_kinematics():
    kinematics = Kinematics(GantryTau(prototypes.L1))
    home = kinematics.home.r
    path = {"r_ref": lambda t: home + np.array([0.05 * math.sin(5 * t), 0.0, 0.0])}
    own = ExternalKinematics.of(kinematics, ["q_ref"])
    plant = slide(Channel("q_ref", "m", 3))
    found = Controller(plant, lambda t, v: {}, kinematics=own, references=path).run(STOP)
    r, _ = kinematics.fk(found["applied.q_ref"])
    assert np.allclose(r, found["r_ref"], atol=1e-9)  # the closed form there and back


def test_kinematics_out_of_reach_by_nan_hold_the_axes():
    kinematics = Kinematics(GantryTau(prototypes.L1))
    own = ExternalKinematics.of(kinematics, ["q_ref"])
    law = lambda t, v: {"r_ref": [0.0, 0.0, 50.0]}  # noqa: E731
    plant = slide(Channel("q_ref", "m", 3))
    found = Controller(plant, law, kinematics=own, references={"r_ref": kinematics.home.r}).run(STOP)
    assert found.timing.unreachable == 51
    assert np.ptp(found["applied.q_ref"], axis=0).tolist() == [0, 0, 0]


def test_kinematics_are_replaced_while_idle_only_and_axes_do_not_jump():
    limits = {"q_ref": AxisLimits(speed=2.0)}
    controller = Controller(
        two_axes(), lambda t, v: {}, kinematics=turned(0.0), references={"r_ref": [0.6, 0.0]}, limits=limits
    )
    with pytest.raises(ModelError, match="found the state 'obtain', expected 'idle', in which alone they"):
        controller.replace_kinematics(turned(0.5))
    controller.idle()
    controller.replace_kinematics(turned(0.5))
    with pytest.raises(ModelError, match="found other poses or axes"):
        controller.replace_kinematics(ExternalKinematics(np.array, (Channel("x", "m"),), ["q_ref"]))
    controller.obtain()
    with pytest.raises(ModelError, match="found the state 'obtain'"):
        controller.replace_kinematics(turned(0.0))
    applied = controller.run(STOP)["applied.q_ref"]
    assert np.allclose(applied[-1], [0.6 * math.cos(0.5), -0.6 * math.sin(0.5)], rtol=1e-14)


def test_replaced_in_a_run_the_way_to_the_new_axes_is_a_ramp():
    seen = []

    def law(t, v):
        if controller.state == "idle" and not seen:
            controller.replace_kinematics(turned(0.5))
            seen.append(controller.k)
        elif controller.state == "obtain":
            with pytest.raises(ModelError):
                controller.replace_kinematics(turned(1.0))
        return {}

    limits = {"q_ref": AxisLimits(speed=2.0)}
    references = {"r_ref": [0.6, 0.0]}
    controller = Controller(two_axes(), law, kinematics=turned(0.0), references=references, limits=limits)
    controller.idle(at=0.04)
    applied = controller.run(STOP)["applied.q_ref"]
    assert seen == [10]
    assert applied[9].tolist() == [0.6, 0.0]
    assert np.abs(np.diff(applied, axis=0)).max() <= 0.008 * (1 + 1e-12)
    assert np.allclose(applied[-1], [0.6 * math.cos(0.5), -0.6 * math.sin(0.5)], rtol=1e-14)


REFUSED = [
    (dict(limits={"q": AxisLimits()}), "limits: the plant has no input 'q'; there is q_ref."),
    (dict(limits={"q_ref": AxisLimits(speed=0.0)}), "limits q_ref: found speed=0.0, expected numbers above"),
    (dict(limits={"q_ref": AxisLimits([1, 2, 3])}), "limits q_ref: found [1, 2, 3], expected a number, or"),
    (dict(limits={"q_ref": AxisLimits("low")}), "limits q_ref: found 'low', expected a number, or 2 of them"),
    (dict(limits={"q_ref": AxisLimits(math.nan)}), "limits q_ref: found nan, expected a number, or 2 of"),
    (dict(limits={"q_ref": AxisLimits(1, 0)}), "limits q_ref: found minimum above maximum, expected it"),
    (dict(limits={"q_ref": AxisLimits(0.1)}), "found q_ref[0] = 0 at the start, expected a number in [0.1,"),
    (dict(references={"q": 0.0}), "references: there is no 'q'; there is q_ref."),
    (dict(kinematics=turned(0.0)), "references: found no 'r_ref', expected the pose to begin with"),
    (dict(kinematics=turned(0.0), references={"r_ref": [3.0, 0.0]}), "beyond 1 m, expected a reachable"),
    (
        dict(kinematics=ExternalKinematics(np.array, POSE, ["axes"]), references={"r_ref": [0.0, 0.0]}),
        "kinematics: the plant has no input 'axes'",
    ),
]


@pytest.mark.parametrize(("options", "said"), REFUSED, ids=lambda value: str(value)[:30])
def test_limits_and_kinematics_that_do_not_fit_are_refused_by_name(options, said):
    with pytest.raises(ModelError) as error:
        Controller(two_axes(), lambda t, v: {}, **options).run(STOP)
    assert said in str(error.value)


@pytest.mark.parametrize(
    ("function", "said"),
    [
        (lambda pose: 1 / 0, "kinematics: raised ZeroDivisionError: division by zero; mend the function"),
        (lambda pose: pose[:1], "kinematics: answered 1 numbers, expected 2, one for each axis"),
    ],
)
def test_kinematics_that_fail_say_so(function, said):
    own = ExternalKinematics(function, POSE, ["q_ref"])
    with pytest.raises(SolveError) as error:
        Controller(two_axes(), lambda t, v: {}, kinematics=own, references={"r_ref": [0.0, 0.0]}).run(STOP)
    assert said in str(error.value)


def test_kinematics_without_poses_are_none():
    with pytest.raises(ModelError, match=r"kinematics: found poses=\(\) and axes=\['q'\], expected channels"):
        ExternalKinematics(np.array, (), ["q"])
    with pytest.raises(ModelError, match="kinematics: found 3, expected a function of a pose"):
        ExternalKinematics(THREE, POSE, ["q"])


@dataclass(frozen=True)
class Millimetres:
    name: str = "q_ref"
    unit: str = "mm"
    size: int = 1
    minimum: float | None = None
    maximum: float | None = None
    elements: tuple[str, ...] = ("q_ref",)


def test_inputs_in_units_that_are_not_si_are_refused_by_name():
    part = PythonComponent(
        lambda t, v: {"q": 0.0}, inputs=[Millimetres()], outputs=[Channel("q", "m")], sampled=False
    )
    with pytest.raises(ModelError, match=r"plant\.q_ref: .*mm"):
        Controller(part, lambda t, v: {})


def test_a_plant_without_inputs_is_refused():
    part = PythonComponent(lambda t, v: {"q": 0.0}, inputs=[], outputs=[Channel("q", "m")], sampled=False)
    with pytest.raises(ModelError, match="plant: found no inputs, expected those that take references"):
        Controller(part, lambda t, v: {})
