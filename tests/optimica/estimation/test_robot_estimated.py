"""Ten numbers of the three-link robot from four seconds at 250 Hz: masses and friction, within a minute."""

import time
from typing import Any

import numpy as np

from gantrytau import Fixed, simulate, translate
from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import Free, Samples
from gantrytau_optimica.estimation.estimate import estimate
from gantrytau_optimica.estimation.experiments import Experiment

TIMES = np.linspace(0.0, 4.0, 1001)
STEP = 0.5  # s, from rest to rest


def from_rest_to_rest(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, velocity and acceleration of the tool between random points, by polynomials of fifth order, (n, 3)."""
    middle, size = np.array([0.4, 2.8, -0.8]), np.array([0.25, 0.15, 0.15])
    points = middle + np.random.default_rng(seed).uniform(-1.0, 1.0, (9, 3)) * size
    number = np.minimum((TIMES / STEP).astype(int), 7)
    s, way = TIMES / STEP - number, points[number + 1] - points[number]
    place = 10 * s**3 - 15 * s**4 + 6 * s**5
    speed, push = 30 * s**2 - 60 * s**3 + 30 * s**4, 60 * s - 180 * s**2 + 120 * s**3
    return points[number] + way * place[:, None], way * speed[:, None] / STEP, way * push[:, None] / STEP**2


def test_masses_and_friction_of_the_robot_within_a_minute():
    """Carts that turn around eight times: steep friction, corners of the forces at every sample, guesses far off."""
    l1 = prototypes.L1
    truth: dict[str, Any] = {"plate_mass": l1.plate_mass}
    for i in range(3):
        names = (f"carts[{i}].m", f"carts[{i}].law.f_c", f"carts[{i}].law.f_v")
        truth |= dict(zip(names, (l1.cart_masses[i], l1.coulomb[i], l1.viscous[i]), strict=True))
    r, v, a = from_rest_to_rest(5)
    drives = [f"carts[{i}].f" for i in range(3)]
    forces = translate(GantryTau(l1)).function(["tool.r", "tool.v", "der(tool.v)"], drives)
    found = np.array([np.ravel(forces(*row)) for row in zip(r, v, a, strict=True)])
    pushed = {name: (TIMES, found[:, i]) for i, name in enumerate(drives)}
    begun = GantryTau(l1, tool=dict(r=Fixed(list(r[0])), v=Fixed(list(v[0]))))
    motion = simulate(begun, stop=4.0, points=1001, inputs=pushed)
    noise = np.random.default_rng(0)
    measured = {
        f"carts[{i}].s": Samples(
            TIMES, motion[f"carts[{i}].s"] + noise.normal(0.0, 1e-4, 1001), deviation=1e-4
        )
        for i in range(3)
    }
    start = {"tool.r": list(r[0]), "tool.v": list(v[0])}
    guesses = {n: Free(20.0 if n.endswith(".m") else 200.0, min=0.0) for n in truth} | {
        "plate_mass": Free(5.0)
    }
    begin = time.process_time()
    fit = estimate(GantryTau(l1), guesses, Experiment(measured, inputs=pushed, start=start))
    assert time.process_time() - begin < 60.0
    for name, value in truth.items():
        assert abs(fit.parameters[name] - value) < 4 * fit.deviations[name], name
    assert fit.warnings == ()
    assert 1e-3 < fit.probability < 1 - 1e-3
