"""Poses where angles are 0, 90 or 180 degrees, links are level or upright, and robots stand in planes of symmetry."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from gantrytau import Dae, Model, simulate, translate
from gantrytau_models import DeltaRobot, FourBar, GantryTau, prototypes
from tests.answers.test_other_mechanisms import SliderCrank, TwoLinkArm
from tests.fmu.exported import export
from tests.independent_routes.routes import attempted, called, compiled, flat, initialised

QUARTERS = [-math.pi / 2, 0.0, math.pi / 2, math.pi]
NEAR = [0.0, 1e-13]
SAME = 1e-9  # of the largest value


@dataclass(frozen=True)
class Case:
    """A model, values of its states by name, and what is found there; exported: whether an FMU is made of it."""

    model: Model
    poses: tuple[Mapping[str, float], ...]
    find: tuple[str, ...]
    exported: bool = False


def turned(name: str) -> tuple[Mapping[str, float], ...]:
    """An angle at all quarters, and beside them."""
    return tuple({name: a + e} for a in QUARTERS for e in NEAR)


def tool_poses(*points: tuple[float, float, float]) -> tuple[Mapping[str, float], ...]:
    return tuple({f"tool.r[{k}]": x for k, x in enumerate(point)} for point in points)


CASES = {
    "four bars": Case(FourBar(), turned("crank.phi"), ("der(crank.w)", "loops[0].f"), True),
    "a rhomboid of four bars": Case(
        FourBar(1.2, 0.5, 1.2, 0.6), turned("crank.phi"), ("der(crank.w)", "loops[0].f")
    ),
    "a crank": Case(SliderCrank(), tuple({**pose, "der(phi)": 2.0} for pose in turned("phi")), ("f",), True),
    "an arm": Case(
        TwoLinkArm(),
        tuple({"phi_a": a, "phi_b": b + e} for a in QUARTERS for b in QUARTERS for e in NEAR),
        ("der(der(phi_a))", "der(der(phi_b))", "f_a", "n_a"),
    ),
    "three links": Case(
        GantryTau(prototypes.GT_A),
        tool_poses((0.5, 3.0, -0.6), (0.25, 3.0, -0.6), (0.5, 3.0, -0.4)),
        ("der(tool.v)", "arms[0].link.tension"),
        True,
    ),
    "a delta robot": Case(
        DeltaRobot(), tool_poses((0, 0, -0.7), (0.1, 0, -0.7), (0, 0.1, -0.7), (0, 0, -0.5)), ("der(tool.v)",)
    ),
}


def completed(dae: Dae, pose: Mapping[str, float]) -> dict[str, np.ndarray]:
    """Values of all states and inputs: some speeds and forces besides the pose."""
    point = {s: float(dae.numbers([s], dae.start)[0]) for s in dae.states}
    point |= {n: 0.7 + 0.1 * k for k, n in enumerate(dae.inputs)} | dict(pose)
    return {n: np.array(x) for n, x in point.items()}


def same(found: np.ndarray, expected: np.ndarray) -> bool:
    """NaN is not the same as anything."""
    return bool(np.max(np.abs(found - expected)) <= SAME * np.max(np.abs(expected)))


@pytest.mark.parametrize("name", CASES)
def test_a_symmetric_pose_is_a_pose_as_any_other(name, tmp_path):
    case = CASES[name]
    dae, find = translate(case.model), list(case.find)
    given = [*dae.states, *dae.inputs]
    function = dae.function(given, find)
    routes: dict[str, Any] = {"function": lambda p: called(function, given, p)}
    binary = compiled(function, tmp_path)
    routes["C"] = lambda p: called(binary, given, p)
    if case.exported:
        fmu = attempted(export, dae, tmp_path / "model.fmu")
        routes["FMU"] = lambda p: initialised(fmu, dae, p, find)
    for pose in case.poses:
        point = completed(dae, pose)
        values = dae.evaluate(point)
        expected = flat([values[n] for n in find])
        assert np.all(np.isfinite(expected))
        for route, answer in routes.items():
            assert same(answer(point), expected), (route, pose, answer(point), expected)


def test_a_linkage_that_is_driven_there_is_simulated():
    """The torque of the motion is that of all other angles."""
    free, driven = translate(FourBar()), translate(FourBar(), given=["crank.phi"])
    begin = driven.start["crank.phi"]
    for angle in QUARTERS:
        far = angle - begin
        held = simulate(
            driven, stop=1.0, points=3, inputs={"crank.phi": lambda t, far=far: begin + far * t**3}
        )
        expected = free.evaluate({"crank.phi": angle, "crank.w": 3 * far, "der(crank.w)": 6 * far})
        for name in ("torque", "loops[0].f"):
            assert same(flat([held.final(name)]), flat([expected[name]])), (name, angle)
