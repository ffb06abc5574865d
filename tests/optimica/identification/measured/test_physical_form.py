"""Masses, damping and stiffness from black boxes: Dressler (2012), (6.14) and (6.15)."""

import numpy as np
import pytest
import scipy.linalg

from gantrytau import ModelError, StateSpace, linearize
from gantrytau_models import prototypes
from gantrytau_optimica import physical_form
from gantrytau_optimica.identification import IdentificationError, MechanicalForm
from tests.models.mechanisms.test_impulses import at_rest

PERIOD = 0.004  # s
MASS = 10.5 * np.eye(2)  # kg, a plate without wrist
DAMPING = np.array([[107.0, 3.5], [3.5, 98.0]])  # kg/s
STIFFNESS = 1e3 * np.array([[107.0, 2.5], [2.5, 86.0]])  # N/m
TRUE = MechanicalForm(MASS, DAMPING, STIFFNESS)
PRINTED = (
    np.array([[0.0278, -0.0331], [-0.1759, 0.3086]]),
    np.array([[3.7432, -4.7826], [-9.7408, -3.4976]]),
    1e3 * np.array([[-3.7326, -1.5671], [6.9209, 0.5560]]),
)  # M, D and K of the thesis, whose stiffness is -K


def other_states(system, seed=0):
    """The same system in states that mean nothing."""
    T = np.random.default_rng(seed).normal(size=system.A.shape)
    return StateSpace(
        np.linalg.solve(T, system.A @ T), np.linalg.solve(T, system.B), system.C @ T, period=system.period
    )


def forces(seed, count=4000, hold=3):
    """Random forces of 50 N, (N, 2)."""
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], (count // hold + 1, 2))
    return 50.0 * np.repeat(signs, hold, axis=0)[:count]


def measured(form, seed, noise):
    """Forces and the first two positions of a structure, noisy."""
    system = form.system
    sampled = StateSpace(system.A, system.B[:, :2], system.C[:2]).discrete(PERIOD)
    u = forces(seed)
    y = sampled.simulate(u)
    return u, y + noise * np.random.default_rng(seed + 100).normal(size=y.shape)


def black_box(u, y, order=4, taps=120):
    """Impulse responses by least squares, then Ho and Kalman (1966)."""
    rows, inputs = u.shape
    late = np.hstack([np.vstack([np.zeros((k, inputs)), u[: rows - k]]) for k in range(1, taps)])
    h = np.linalg.lstsq(late, y, rcond=None)[0].reshape(taps - 1, inputs, -1).transpose(0, 2, 1)
    half, outputs = (taps - 1) // 2, y.shape[1]
    left, sizes, right = np.linalg.svd(np.block([[h[i + j] for j in range(half)] for i in range(half)]))
    left, right = left[:, :order] * np.sqrt(sizes[:order]), np.sqrt(sizes[:order, None]) * right[:order]
    A = np.linalg.lstsq(left[:-outputs], left[outputs:], rcond=None)[0]
    return StateSpace(A, right[:, :inputs], left[:outputs], period=PERIOD)


def off(found, true=TRUE):
    """Relative errors of M and K by norm."""
    return [
        np.linalg.norm(getattr(found, name) - getattr(true, name)) / np.linalg.norm(getattr(true, name))
        for name in ("M", "K")
    ]


def kinds(form):
    return {finding.kind for finding in form.findings}


@pytest.mark.parametrize("sampled", [True, False])
@pytest.mark.parametrize("structured", [True, False])
def test_a_structure_is_found_from_states_that_mean_nothing(sampled, structured):
    system = TRUE.system.discrete(PERIOD) if sampled else TRUE.system
    form = physical_form(other_states(system), structured=structured)
    for found in (form, form.direct):
        assert np.allclose(found.M, MASS, rtol=0, atol=1e-8 * 10)
        assert np.allclose(found.D, DAMPING, rtol=0, atol=1e-8 * 100)
        assert np.allclose(found.K, STIFFNESS, rtol=0, atol=1e-8 * 1e5)
    assert form.definite
    assert not form.findings
    assert form.fit > 99.999


@pytest.mark.parametrize("factor", [1e-9, 1e9])
def test_units_of_force_do_not_matter(factor):
    form = physical_form(
        other_states(
            MechanicalForm(factor * MASS, factor * DAMPING, factor * STIFFNESS).system.discrete(PERIOD)
        )
    )
    assert np.allclose(off(form, MechanicalForm(factor * MASS, DAMPING, factor * STIFFNESS)), 0, atol=1e-8)
    assert form.definite


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_masses_and_stiffness_from_noisy_motion(seed):
    """Noise of 50 um on 1.1 mm rms, the signal of an encoder with fifty times its noise."""
    u, y = measured(TRUE, seed, 5e-5)
    box = black_box(u, y)
    own, best = physical_form(box), physical_form(box, measured=(u, y))
    assert max(*off(own), *off(own.direct)) < 0.06
    assert max(off(best)) < 0.01
    assert own.definite
    assert best.definite
    assert not (own.findings)
    assert not (best.findings)
    assert np.allclose(best.undamped, TRUE.undamped, rtol=1e-3)


def test_the_fit_begins_anywhere_and_rests_anywhere():
    u, y = measured(TRUE, 4, 0.0)
    box = black_box(u, y)
    late = physical_form(box, measured=(u[500:], y[500:] + 0.3))
    assert max(off(late)) < 1e-5
    assert late.fit > 99.99


def swaying(share):
    """The structure on a frame of 88 kg that sways at about 7.4 Hz and is pushed by its motion."""
    frame = 88 * (2 * np.pi * 7.4) ** 2 + share
    return MechanicalForm(
        scipy.linalg.block_diag(MASS, 88.0),
        scipy.linalg.block_diag(DAMPING, 300.0),
        np.block(
            [
                [STIFFNESS, -share * np.array([[1.0], [0.6]])],
                [-share * np.array([[1.0, 0.6]]), np.array([[frame]])],
            ]
        ),
    )


def test_noise_is_no_mode():
    u, y = measured(TRUE, 1, 2e-4)
    form = physical_form(black_box(u, y), measured=(u, y))
    assert form.fit < 88
    assert "fit" not in kinds(form)
    assert max(off(form)) < 0.06


def test_a_mode_that_is_not_modelled_is_told():
    u, y = measured(swaying(1e5), 1, 1e-6)
    form = physical_form(black_box(u, y), measured=(u, y))
    assert "fit" in kinds(form)
    assert form.fit < 85


def test_modes_of_a_robot_under_its_servos_are_those_of_its_linearization():
    """Two routes: forces at the plate with positions of 1 um noise, and exact derivatives of the model's equations."""
    model, starts = at_rest()
    linear = linearize(model, at=starts, inputs=["f"], outputs=["robot.tool.r"])
    sampled = linear.discrete(PERIOD)
    rng = np.random.default_rng(0)
    u = 50.0 * np.repeat(rng.choice([-1.0, 1.0], (2000, 3)), 3, axis=0)
    y = sampled.simulate(u) + 1e-6 * rng.normal(size=u.shape)
    form = physical_form(black_box(u, y, order=6, taps=200), measured=(u, y))
    exact = linear.eigenfrequencies[(linear.eigenfrequencies > 5) & (linear.eigenfrequencies < 20)][::2]
    assert form.modes.frequencies == pytest.approx(exact, rel=2e-3)  # frame 7.4, arms 10.0 and 12.0 Hz
    assert form.definite
    assert form.fit > 98
    # seen from the plate, the frame is a part of the mass along x
    assert form.M[0, 0] > 10 * prototypes.L1_flexible.plate_mass


def test_what_is_not_definite_is_never_hidden():
    """A negative stiffness under a damper is stable in the sampled model of another sign: M and K change theirs."""
    turned = TRUE.system
    form = physical_form(StateSpace(turned.A, turned.B @ np.diag([1.0, -1.0]), turned.C))
    assert not form.definite
    assert form.direct.indefinite == ("M", "D", "K")
    assert not {"M", "K"} & set(form.indefinite)  # by construction
    assert {"indefinite", "disagreement", "fit"} <= kinds(form)
    assert not physical_form(
        StateSpace(turned.A, turned.B @ np.diag([1.0, -1.0]), turned.C), structured=False
    ).definite


def test_forces_that_do_not_belong_to_the_positions():
    turned = TRUE.system
    form = physical_form(StateSpace(turned.A, turned.B @ np.array([[1.0, 0.6], [-0.6, 1.0]]), turned.C))
    assert "not symmetric" in kinds(form)


def test_printed_matrices_swing_with_the_other_sign_of_stiffness():
    """(6.15): 13.8 and 103.3 Hz of det(M lambda + K) = 0; with K as it is printed s = +-sqrt(lambda) are real."""
    M, D, K = PRINTED
    physical = MechanicalForm(M, D, -K)
    assert np.allclose(physical.undamped, [13.826, 103.337], rtol=0, atol=5e-4)
    assert np.isnan(MechanicalForm(M, D, K).undamped).all()
    assert "K" in physical.indefinite
    assert not physical.definite
    assert "K" in MechanicalForm(M, D, K).indefinite
    assert np.linalg.det(physical.D) == pytest.approx(-59.679, abs=1e-3)
    assert physical.asymmetry["K"] > 1


def test_modes_are_roots_of_the_determinant():
    rng = np.random.default_rng(3)
    roots = [S @ S.T + 0.1 * np.eye(4) for S in rng.normal(size=(3, 4, 4))]
    form = MechanicalForm(roots[0], 0.1 * roots[1], 1e4 * roots[2])
    modes = form.modes
    assert np.all(np.diff(modes.frequencies) > 0)
    for s, shape in zip(modes.poles, modes.shapes.T, strict=True):
        terms = [form.M * s**2, form.D * s, form.K]
        assert np.linalg.norm(sum(terms) @ shape) < 1e-9 * sum(np.linalg.norm(term @ shape) for term in terms)
    assert np.allclose(np.sort(form.system.eigenfrequencies)[::2], modes.frequencies)
    undamped = scipy.linalg.eigh(form.K, form.M, eigvals_only=True)
    assert np.allclose(form.undamped, np.sqrt(undamped) / (2 * np.pi))


def test_modes_that_do_not_swing():
    single = MechanicalForm(2.0, 30.0, 100.0)  # (s + 5)(s + 10)
    assert np.allclose(single.modes.poles, [-5, -10])
    assert np.allclose(single.modes.damping, 1)
    free = MechanicalForm(2.0, 0.0, 0.0)
    assert np.allclose(free.modes.frequencies, 0)
    assert not free.definite
    assert free.indefinite == ("D", "K")


@pytest.mark.parametrize(
    "true",
    [
        MechanicalForm(
            np.eye(2), np.diag([0.1, 10.0]), np.array([[40.0, 10.0], [10.0, 4e7]])
        ),  # 1 Hz and 1 kHz
        MechanicalForm(np.diag([1e-3, 1e4]), np.diag([0.01, 10.0]), np.array([[40.0, 10.0], [10.0, 4e7]])),
        MechanicalForm(np.eye(2), np.eye(2), np.diag([1e3, 1e3])),  # the same mode twice
        MechanicalForm(np.eye(2), 2 * np.sqrt(1e3) * np.eye(2), np.diag([1e3, 1e3])),  # twice critical
    ],
    ids=["slow and fast", "light and heavy", "double", "critical"],
)
def test_coordinates_that_are_far_apart_or_alike(true):
    form = physical_form(other_states(true.system.discrete(1e-4)))
    assert max(*off(form, true), *off(form.direct, true)) < 1e-5
    assert form.definite


def test_a_body_that_is_held_by_nothing():
    free = MechanicalForm(np.eye(2), np.eye(2), np.diag([0.0, 1e3]))
    form = physical_form(other_states(free.system.discrete(0.01)))
    assert max(off(form, free)) < 1e-6
    assert form.direct.indefinite == ("K",)


@pytest.mark.parametrize("damping", [0.0, 1.0, 2000.0])
def test_one_coordinate_with_no_damping_and_with_much(damping):
    true = MechanicalForm(10.0, damping, 9e4)
    form = physical_form(true.system.discrete(0.001))
    assert np.allclose(off(form, true), 0, atol=1e-7)
    assert form.D[0, 0] == pytest.approx(damping, abs=1e-5)


def test_a_mode_near_half_of_the_sampling_frequency():
    fast = MechanicalForm(MASS, 0.1 * DAMPING, 50 * STIFFNESS)
    assert fast.undamped[-1] == pytest.approx(113.8, abs=0.1)
    assert "aliased" in kinds(physical_form(fast.system.discrete(PERIOD)))


def test_a_linear_system_comes_back_from_its_samples():
    system = TRUE.system
    again = system.discrete(PERIOD).continuous()
    assert np.allclose(again.A, system.A, rtol=0, atol=1e-9 * np.abs(system.A).max())
    assert np.allclose(again.B, system.B, rtol=0, atol=1e-9 * np.abs(system.B).max())
    assert again.period is None
    assert again.title == "StateSpace, every 0.004 s, continuous"


@pytest.mark.parametrize("tiny", [1e-3, 1e-6])
def test_a_logarithm_that_rounding_spoils_is_refused(tiny):
    A = np.diag([0.9, tiny, tiny, tiny]) + np.diag(np.ones(3), 1)
    T = np.random.default_rng(0).normal(size=(4, 4))
    system = StateSpace(np.linalg.solve(T, A @ T), np.ones((4, 1)), np.ones((1, 4)), period=0.1)
    with pytest.raises(ModelError, match="logarithm is lost to rounding"):
        system.continuous()


SYSTEM = TRUE.system
RATES = StateSpace(SYSTEM.A, SYSTEM.B, SYSTEM.C @ SYSTEM.A)
LAZY = StateSpace(SYSTEM.A, SYSTEM.B[:, :1] @ np.ones((1, 2)), SYSTEM.C)
BLIND = StateSpace(SYSTEM.A, SYSTEM.B, SYSTEM.C[:1].repeat(2, axis=0))
U, Y = np.random.default_rng(0).normal(size=(2, 50, 2))


@pytest.mark.parametrize(
    ("system", "error", "words"),
    [
        (StateSpace(np.eye(4) / 2, np.ones((4, 1)), np.ones((2, 4))), ModelError, "2 outputs and 1 inputs"),
        (
            StateSpace(np.eye(10) / 2, np.ones((10, 2)), np.ones((2, 10)), period=0.004),
            ModelError,
            "order 10 with 2 positions, expected 4, a position and a speed each; identify a model of order 4, or with 5",
        ),
        (StateSpace(np.eye(7), np.ones((7, 2)), np.ones((2, 7))), ModelError, "identify a model of order 4$"),
        (StateSpace(-SYSTEM.A, SYSTEM.B, SYSTEM.C), IdentificationError, "unstable pole s = "),
        (
            StateSpace(1.05 * SYSTEM.discrete(PERIOD).A, SYSTEM.B, SYSTEM.C, period=PERIOD),
            IdentificationError,
            "unstable pole z = ",
        ),
        (RATES.discrete(PERIOD), IdentificationError, "outputs that jump in speed with a force"),
        (BLIND, IdentificationError, "modes that the outputs do not show"),
        (LAZY, IdentificationError, "which has no inverse, expected that every force accelerates a position"),
        (
            StateSpace(np.diag([0.5, -0.5]), np.ones((2, 1)), np.ones((1, 2)), period=0.004),
            ModelError,
            "pole at z = -0.5, expected none at zero or on the negative real axis",
        ),
        (
            StateSpace(np.diag([0.5, 0.0]), np.ones((2, 1)), np.ones((1, 2)), period=0.004),
            ModelError,
            "pole at z = 0",
        ),
    ],
)
def test_systems_that_have_no_such_form(system, error, words):
    with pytest.raises(error, match=words):
        physical_form(system)


@pytest.mark.parametrize(
    ("motion", "words"),
    [
        (U, r"measured=ndarray, expected \(u, y\)"),
        ((U, Y[:, :1]), "found y of 50 x 1, expected n x 2 numbers"),
        ((U, Y[:40]), "50 samples of u and 40 of y"),
        ((U[:9], Y[:9]), "9 samples of u and 9 of y, expected as many of both, 40 at least"),
        ((U, 0 * Y), r"found that y\[0\] never changes"),
        ((U * [1, 0], Y), r"found that u\[1\] never changes, expected motion; leave it out, or excite it"),
        ((np.where(np.arange(50) == 3, np.nan, 1.0)[:, None] * U, Y), r"found u\[3, 0\] = nan"),
    ],
)
def test_motion_that_cannot_be_fitted(motion, words):
    with pytest.raises(ModelError, match=words):
        physical_form(SYSTEM.discrete(PERIOD), measured=motion)


def test_motion_needs_a_period():
    with pytest.raises(ModelError, match="found measured= for a continuous system, expected one with the"):
        physical_form(SYSTEM, measured=(U, Y))
    with pytest.raises(ModelError, match="found a continuous system, expected one with a period"):
        SYSTEM.continuous()


@pytest.mark.parametrize(
    ("matrices", "words"),
    [
        ((np.ones((2, 3)), 1, 1), r"M has shape \(2, 3\), expected \(2, 2\)"),
        ((np.eye(2), 1, np.eye(2)), r"D has shape \(1, 1\), expected \(2, 2\)"),
        ((np.eye(2), np.eye(2), np.full((2, 2), np.nan)), "K is not finite"),
        ((np.ones((2, 2)), np.eye(2), np.eye(2)), "which has no inverse, expected a mass in every direction"),
        (("heavy", 1, 1), "M that is no matrix of numbers"),
    ],
)
def test_matrices_that_are_no_structure(matrices, words):
    with pytest.raises(ModelError, match=words):
        MechanicalForm(*matrices)


def test_words():
    form = physical_form(SYSTEM)
    assert repr(form).startswith("<PhysicalForm of 2 coordinates\n  M = [[10.5")
    assert "14.38 Hz, damping 0.0513" in repr(form.modes)


def test_positions_of_a_model_that_lacks_modes_are_answered_and_told():
    """They jump in speed with a force, as speeds do, but stay where a constant force has moved them."""
    fastest = np.abs(SYSTEM.poles).max()
    lacking = StateSpace(SYSTEM.A, SYSTEM.B, SYSTEM.C + SYSTEM.C @ SYSTEM.A / fastest)
    found = physical_form(lacking.discrete(PERIOD))
    assert found.findings[0].kind == "modes"
    assert "a model of order 4" in found.findings[0].message
    assert not found.indefinite
