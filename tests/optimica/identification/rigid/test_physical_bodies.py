"""Ten inertial parameters of a body: recovered, and never those of a body that cannot be."""

import re
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares

from gantrytau import ModelError, translate
from gantrytau_models import DeltaRobot
from gantrytau_optimica import identify
from gantrytau_optimica.identification.least_squares.factors import Factors
from gantrytau_optimica.identification.least_squares.parameter_limits import Condition, ParameterLimits
from gantrytau_optimica.identification.least_squares.regression import fit
from gantrytau_optimica.identification.rigid.body_parameters import BodyParameters, pseudo_inertia
from tests.families import NIGHTLY
from tests.optimica.identification.rigid.bodies import CENTRE, INERTIA, MASS, Carried, log
from tests.optimica.identification.rigid.test_identify_closed_chains import CASES, log_of

BODY = BodyParameters("tool", "plate_mass", "tool.m")
ASKED: dict[str, Any] = dict(parameters="tool", friction=None, minimum_speed=0.0)


def ten(found) -> np.ndarray:
    return np.array([found.parameters[n] for n in BODY.names])


@pytest.fixture(scope="module")
def robot():
    """The plate as its maker would have it."""
    return Carried(tool=dict(m=7.0, r_cm=[0.0, 0.0, 0.0], J=np.diag([0.1, 0.1, 0.1])))


@pytest.fixture(scope="module")
def dae(robot):
    return translate(robot)


def test_what_the_model_has_and_the_ten_parameters_are_the_same_body():
    """Steiner's law there and back; the pseudo-inertia is that of points: sum m (x, 1)(x, 1)'."""
    rng = np.random.default_rng(0)
    m, x = rng.uniform(0.1, 1.0, 20), rng.standard_normal((20, 3))
    points = np.hstack([x, np.ones((20, 1))])
    c = m @ x / m.sum()
    away = x - c
    J = np.trace((away.T * m) @ away) * np.eye(3) - (away.T * m) @ away
    values = dict(zip(BODY.elements, (m.sum(), *c, *J.ravel()), strict=True))
    found = BODY.of_model(values)
    assert np.allclose(pseudo_inertia(found), (points.T * m) @ points, rtol=0, atol=1e-13)
    assert BODY.in_model(found.tolist()) == pytest.approx(values, abs=1e-13)


def test_a_body_is_found_and_stands_in_the_robot(robot):
    found = identify(robot, log(0.1, 0, noise=0.0), **ASKED)
    truth = BODY.of_model(translate(Carried()).parameter_values)
    deviations = np.array([found.deviations[n] for n in BODY.names])
    # what differentiating 100 rows a second leaves, as the deviations have it
    assert np.all(np.abs(ten(found) - truth) < 4 * deviations + 1e-4 * np.abs(truth))
    values = translate(found.robot).parameter_values
    assert values["tool.m"] == pytest.approx(MASS, rel=1e-4)
    assert [values[f"tool.r_cm[{i}]"] for i in range(3)] == pytest.approx(CENTRE, abs=2e-4)
    assert values["tool.J[1,2]"] == pytest.approx(INERTIA[1, 2], abs=2e-3)
    assert values["tool.J[1,2]"] == values["tool.J[2,1]"]
    assert "no such body" not in [x.kind for x in found.findings]


def test_noise_never_makes_a_body_that_cannot_be(dae):
    """At turns of 0.02 rad least squares alone give negative densities, as in the literature; what is not told is named."""
    impossible, seeds = 0, 20 if NIGHTLY else 5
    for seed in range(seeds):
        alone = identify(dae, log(0.02, seed), physical=False, **ASKED)
        held = identify(dae, log(0.02, seed), **ASKED)
        lowest = np.linalg.eigvalsh(pseudo_inertia(ten(alone)))[0]
        assert np.linalg.eigvalsh(pseudo_inertia(ten(held)))[0] > 0
        told = [x for x in held.findings if x.kind == "no such body"]
        assert bool(told) == (lowest < 0)
        if told:
            impossible += 1
            assert all(n in told[0].message for n in held.weak)
            assert any(n.startswith("tool.inertia") for n in held.weak)
        assert np.sum(held.squares) <= 1.001 * np.sum(alone.squares)
    assert impossible >= 0.75 * seeds


def test_more_turning_needs_no_condition(dae):
    held, alone = (identify(dae, log(0.3, 1), physical=physical, **ASKED) for physical in (True, False))
    assert held.parameters == alone.parameters


def test_a_mass_that_was_weighed_is_kept(dae):
    found = identify(dae, log(0.02, 3), fixed=dict(plate_mass=MASS), **ASKED)
    assert "plate_mass" not in found.parameters
    p = np.array([MASS, *(found.parameters[n] for n in BODY.names[1:])])
    assert np.linalg.eigvalsh(pseudo_inertia(p))[0] > 0
    assert found.model_values["tool.r_cm[0]"] == pytest.approx(p[1] / MASS)


def test_the_least_squares_within_the_condition_are_those_over_factors_of_the_matrix():
    """Two routes: a barrier, and any C = L L' by scipy, which has no other minimum where L is square."""
    rng = np.random.default_rng(1)
    constant = pseudo_inertia(np.zeros(10))
    slopes = np.array([pseudo_inertia(e) for e in np.eye(10)])
    limits = ParameterLimits(
        np.array([*[-np.inf] * 10, 0.0]), (Condition("tool", constant, np.arange(10), slopes),)
    )
    nominal = np.array([5.0, 0, 0, 0, 0.2, 0.2, 0.3, 0, 0, 0, 1.0])
    A = rng.standard_normal((200, 11))
    b = A @ np.array([5.0, 1.0, -1.0, 0.5, 0.2, 0.3, 0.1, 0.1, 0.2, 0.0, -0.3]) + rng.standard_normal(200)
    factors = Factors.of(A, b)
    found = fit(factors, nominal, limits)
    lower = np.tril_indices(4)

    def of_factor(x: np.ndarray) -> np.ndarray:
        L = np.zeros((4, 4))
        L[lower] = x[:10]
        C = L @ L.T
        inertia = np.trace(C[:3, :3]) * np.eye(3) - C[:3, :3]
        return np.array(
            [
                C[3, 3],
                *C[:3, 3],
                *(inertia[i, i] for i in range(3)),
                *(inertia[k] for k in ((1, 0), (2, 0), (2, 1))),
                x[10] ** 2,
            ]
        )

    begin = np.array([*np.eye(4)[lower], 1.0])
    other = least_squares(
        lambda x: factors.R @ of_factor(x) - factors.d, begin, xtol=1e-14, ftol=1e-14, gtol=1e-14
    )
    assert found.tight == ("tool",)
    assert found.active.tolist() == [False] * 10 + [True]
    assert factors.squares(found.p) == pytest.approx(factors.squares(of_factor(other.x)), rel=1e-6)


def test_a_plate_that_does_not_turn_tells_its_mass_only():
    _, _, _, _, (joints, forces, amplitude) = CASES["delta"]
    found = identify(
        DeltaRobot(), log_of(DeltaRobot(plate_mass=0.7), joints, forces, amplitude), cutoff=8.0, **ASKED
    )
    assert found.parameters["plate_mass"] == pytest.approx(0.7, rel=5e-3)
    (silent,) = (x for x in found.findings if x.kind == "silent")
    assert all(n in silent.message for n in BODY.names[1:])
    assert found.parameters["tool.inertia[2,2]"] == 2e-3  # the robot's own


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        (dict(parameters=["tool", "tool.r_cm[0]"]), "tool.r_cm[0] and the body tool stand together"),
        (dict(fixed={"tool.J[0,0]": 0.1}), "tool.J[0,0] and the body tool stand together"),
        (dict(fixed=dict(plate_mass=0.0)), "the body tool has a mass of 0 kg, expected more than 0 to begin"),
    ],
)
def test_what_is_set_twice_or_has_no_mass_is_refused(keywords, words):
    with pytest.raises(ModelError, match=re.escape(words)):
        identify(Carried(), log(0.1, 0), **(ASKED | keywords))
