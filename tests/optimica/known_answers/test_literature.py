"""Problems of the literature: cold, refined, and driven by another integrator (DOP853) with the inputs found.

A line: the converged objective, elements of the cold solve (others than 50 where a switch or a demanded point inside of one
of 50 costs more than 1e-4), and the error of the printed value, relative. All but a few take seconds each, and run in
nightly ones. Converged: closed forms, or collocation by hand on 200 to 800 elements beside ours. Two values of PSOPT's own
meshes are not: its two masses (2.1050) and its arm of two links (2.9887) are 2.11422 and 2.98228 on finer ones; its drag of
the rocket, exp(-500 h) for exp(-500 (h - 1)), is none. The alp rider is no line: errors grow by e^40 in its 20 s, so that
no integrator plays its inputs back.
"""

from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from gantrytau_optimica import optimize
from tests.families import first_of
from tests.optimica.known_answers import literature_problems as literature
from tests.optimica.known_answers import psopt_problems as psopt
from tests.optimica.known_answers.test_classics import HangGlider, ParticleSteering, Rayleigh, RobotArm
from tests.optimica.known_answers.test_singular import CatalystMixing, Goddard
from tests.optimica.known_answers.test_state_constraints import JacobsonLele
from tests.optimica.problems import BoundedOscillator, FastestMass, FastestOscillator, LinearQuadratic, Mass


class LimitedMass(FastestMass):
    mass = Mass(u=dict(min=-1.0, max=1.0), v=dict(max=0.5))


def hypersensitive() -> float:
    """x'' = 2 x between 1.5 and 1, u = x' + x; the integral of (x^2 + u^2) / 2."""
    s = np.sqrt(2.0)
    a, b = np.linalg.solve([[1, 1], [np.exp(10 * s), np.exp(-10 * s)]], [1.5, 1.0])

    def cost(t: float) -> float:
        up, down = a * np.exp(s * t), b * np.exp(-s * t)
        return ((up + down) ** 2 + ((1 + s) * up + (1 - s) * down) ** 2) / 2

    return float(sum(quad(cost, k, k + 1, epsabs=1e-13)[0] for k in range(10)))


PROBLEMS = [
    (literature.SwingUp, 58.80766746, 50, 1e-7),
    (literature.BrysonDenham, 4.0, 50, 1e-6),
    (literature.Hull, 2.5 * (1.5 / 26) ** 2 + 2.5 * (7.5 / 26) ** 2, 50, 1e-9),
    (literature.LinearHypersensitive, hypersensitive(), 50, 1e-6),
    (literature.Breakwell, 40 / 9, 50, 1e-6),
    (literature.Brachistochrone, 1.801603, 50, 1e-6),
    (literature.CubicHypersensitive, 1.330806905, 200, 1e-6),
    (literature.RestToRest, 20.0, 50, 1e-6),
    (literature.MoonLander, -0.3953543, 50, 1e-6),
    (literature.MountainCar, 102.3675, 50, 5e-6),
    (literature.Reorientation, 28.630406, 50, 1e-5),
    (CatalystMixing, -0.0480556815, 50, 1e-6),
    (Goddard, -1.012837, 50, 2e-6),
    (ParticleSteering, 0.5545708783, 50, 1e-6),
    (RobotArm, 9.14091, 50, 1e-5),
    (HangGlider, -1248.03103, 50, 1e-6),
    (psopt.HangingChain, 5.0684801, 50, 1e-6),
    (psopt.MaximumRange, -1.7123149, 50, 1e-6),
    (psopt.MixedRayleigh, 44.80446, 50, 1e-6),
    (psopt.Isoperimetric, -0.3755038, 50, 1e-6),
    (psopt.InteriorPoint, 0.92053144, 52, 1e-6),
    (psopt.CraneSwing, 5.150445e-3, 50, 1e-5),
    (psopt.Singular, 0.1192475, 50, 1e-6),
    (psopt.TwoLinkArm, 2.982280, 50, 1e-6),
    (psopt.TwoMasses, 2.114217, 100, 1e-6),
    (psopt.Missile, 40.911948, 50, 1e-6),
    (psopt.Reentry, -34.141184, 50, 1e-6),
    (psopt.AirlessGoddard, -1.025339, 50, 1e-6),
    (psopt.VanDerPol, 5.278051, 50, 1e-6),
    (psopt.Ascent, 143.58053, 50, 1e-6),
    (psopt.Farthest, -0.25, 50, 1e-6),
    (JacobsonLele, 0.1698212, 50, 1e-6),
    (Rayleigh, 29.37610, 50, 1e-5),
    (BoundedOscillator, 3.174982, 100, 1e-6),
    (FastestOscillator, 2.28117, 50, 1e-5),
    (LimitedMass, 2.5, 50, 1e-6),
    (LinearQuadratic, 50.9836626, 50, 1e-6),
]
NAMED = [pytest.param(*row, id=row[0].__name__) for row in PROBLEMS]


@pytest.mark.parametrize(("problem", "value", "elements", "printed"), first_of(NAMED, 3))
def test_cold(problem, value, elements, printed):
    found = optimize(problem, elements=elements)
    assert found.objective == pytest.approx(value, rel=1e-4)


@pytest.mark.parametrize(("problem", "value", "elements", "printed"), first_of(NAMED, 3))
def test_refined(problem, value, elements, printed):
    found = optimize(problem, refine=1e-6)
    assert found.refinement.reached
    assert found.objective == pytest.approx(value, rel=3e-6 + printed)
    states, end, sizes = driven(found)
    missed = {name: abs(end[k] - found.final(name)) / sizes[k] for k, name in enumerate(states)}
    # ten times the accuracy: ends of states without a condition, too
    assert max(missed.values()) < 1e-5, missed


def driven(found: Any) -> tuple[list[str], np.ndarray, np.ndarray]:
    """States by name, their ends by DOP853 with the inputs found, and their sizes."""
    (trajectory,) = found.phases.values()
    phase, closed = trajectory.phase, found.built.closed
    symbols = [a.symbol for a in phase.algebraics]
    forms = [ca.densify(closed[a.name]) for a in phase.algebraics]
    rates = phase.ode
    if symbols:
        _, (rates,) = ca.substitute_inplace(symbols, forms, [rates], False)
    x, u = (ca.vertcat(*(s.symbol for s in part)) for part in (phase.states, phase.inputs))
    look = ca.Function("rates", [trajectory.problem.time, x, u, trajectory.problem.numbers], [rates])
    sizes = np.array([s.nominal for s in phase.states])
    first = len(phase.states) + len(symbols)
    state = trajectory.signals(np.array([trajectory.start_time]))[: sizes.size, 0]
    borders = trajectory.times(trajectory.mesh.borders)
    for k, (begin, end) in enumerate(pairwise(borders)):

        def moved(t, scaled, k=k, begin=begin, end=end):
            place = np.array([min((t - begin) / (end - begin), 1.0)])
            inputs = trajectory.at(np.array([k]), place)[first:, 0]
            return np.array(look(t, scaled * sizes, inputs, trajectory.numbers)).ravel() / sizes

        state = (
            sizes * solve_ivp(moved, (begin, end), state / sizes, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        )
    return [s.name for s in phase.states], state, sizes
