"""Robots whose loops have no closed form: forces of a model with other masses are explained by these masses."""

import casadi as ca
import numpy as np
import pytest

from gantrytau import translate
from gantrytau.kinematics import Kinematics
from gantrytau_models import DeltaRobot, GantryTau, SixLinkGantryTau, StewartPlatform, prototypes
from gantrytau_optimica import MotionLog, identify

RATE, DURATION = 100.0, 12.0  # Hz, s


def swung(q0: np.ndarray, amplitude: float) -> tuple[np.ndarray, ...]:
    """Rows of t, and smooth q, q', q'' around a pose with two frequencies of its own for each joint."""
    t = np.arange(int(RATE * DURATION)) / RATE
    q, v, a = (np.tile(q0 * (order == 0), (len(t), 1)) for order in range(3))
    for i in range(len(q0)):
        for k, hz in enumerate((0.31 + 0.07 * i, 0.9 + 0.11 * i)):
            w, size, lag = 2 * np.pi * hz, amplitude / (1 + k), 1.3 * i + k
            q[:, i] += size * np.sin(w * t + lag)
            v[:, i] += size * w * np.cos(w * t + lag)
            a[:, i] -= size * w**2 * np.sin(w * t + lag)
    return t, q, v, a


def log_of(robot, joints, forces, amplitude, tool="tool") -> MotionLog:
    """The motion of a robot and its own forces, without noise."""
    dae = translate(robot)
    t, q, v, a = swung(Kinematics(dae, tool=tool, joints=joints).home.q, amplitude)
    names = [*joints, *(f"der({n})" for n in joints), *(f"der(der({n}))" for n in joints)]
    f = dae.function(given=names, find=forces).map(len(t))(*np.hstack([q, v, a]).T[:, None])
    return MotionLog(t, q, np.asarray(ca.vertcat(*f)).T)


CASES = {
    "delta": (
        DeltaRobot,
        dict(plate_mass=0.7, arm_mass=0.35),
        {"plate_mass": "plate_mass", "arm_mass": "arm_mass"},
        dict(parameters=["plate_mass", "arm_mass", "motor_inertia"], friction=None),
        ([f"arms[{i}].phi" for i in range(3)], [f"arms[{i}].tau" for i in range(3)], 0.15),
    ),
    "six links": (
        lambda **values: SixLinkGantryTau(prototypes.L1, **values),
        dict(tool=dict(m=11.0), carts=[dict(m=m) for m in (12.0, 15.0, 40.0)]),
        {"tool.m": "plate_mass", **{f"carts[{i}].m": f"cart_masses[{i}]" for i in range(3)}},
        dict(parameters=["plate_mass", "cart_masses"], friction=None),
        ([f"carts[{i}].s" for i in range(3)], [f"carts[{i}].f" for i in range(3)], 0.1),
    ),
    "stewart": (
        StewartPlatform,
        dict(platform=dict(m=12.0), legs=[dict(piston_mass=1.0 + 0.1 * i) for i in range(6)]),
        {
            "platform.m": "plate_mass",
            **{f"legs[{i}].piston_mass": f"legs[{i}].piston_mass" for i in range(6)},
        },
        dict(parameters=["plate_mass", *(f"legs[{i}].piston_mass" for i in range(6))], friction=None),
        ([f"legs[{i}].s" for i in range(6)], [f"legs[{i}].f" for i in range(6)], 0.02),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_masses_of_closed_chains_are_found(name):
    make, values, names, keywords, (joints, forces, amplitude) = CASES[name]
    plant = make(**values)
    tool = "platform" if name == "stewart" else "tool"
    found = identify(make(), log_of(plant, joints, forces, amplitude, tool), cutoff=8.0, **keywords)
    truth = translate(plant).parameter_values
    for model, public in names.items():
        # what differentiating 100 rows a second and the ends of the filter leave
        assert (
            abs(found.parameters[public] - truth[model])
            < 5e-3 * truth["carts[0].m" if name == "six links" else model]
        )
    assert found.nonlinear == ()


def test_a_smoothing_speed_is_found_by_gauss_newton():
    """Friction is not linear in the speed that smooths its sign: that is told, and found all the same."""
    names = [f"carts[{i}].law.v_s" for i in range(3)]
    plant = GantryTau(prototypes.L1, carts=[dict(law=dict(f_c=100.0 + 10 * i, v_s=0.08)) for i in range(3)])
    joints, forces = [f"carts[{i}].s" for i in range(3)], [f"carts[{i}].f" for i in range(3)]
    found = identify(
        GantryTau(prototypes.L1),
        log_of(plant, joints, forces, 0.1),
        parameters=["plate_mass", *names, *(f"carts[{i}].law.f_c" for i in range(3))],
        friction=None,
        minimum_speed=0.0,
    )
    assert set(names) <= set(found.nonlinear)
    assert "not linear" in [x.kind for x in found.findings]
    for i, name in enumerate(
        names
    ):  # one part in a hundred is left by friction that 100 rows a second cut into steps
        assert abs(found.parameters[name] - 0.08) < 0.01 * 0.08
        assert abs(found.parameters[f"carts[{i}].law.f_c"] - (100 + 10 * i)) < 1.0
