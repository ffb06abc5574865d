"""What data do not tell apart: one matrix, one sentence, whichever fit it comes from."""

import numpy as np
import pytest

from gantrytau_optimica.fitting.rank import (
    LocalJacobian,
    base_of_directions,
    base_parameters,
    dependencies,
    local_messages,
    not_told_apart,
)

NAMES = ["a", "b", "c", "d"]
ALIKE = np.array([1.0, -2.0, 0.0])  # d = a - 2 b
DETERMINED = ["a + d", "b - 2 d"]


def columns(*, idle=False):
    A = np.random.default_rng(0).standard_normal((40, 3))
    return np.column_stack([A, np.zeros(40) if idle else A @ ALIKE])


def null_directions(matrix, scale):
    _, s, V = np.linalg.svd(matrix * scale)
    return V[s < 1e-9 * s[0]]


def test_a_matrix_says_the_same_by_pivots_by_null_directions_and_in_a_nonlinear_fit():
    sentence = not_told_apart(["a", "b", "d"], DETERMINED)
    assert sentence == "a, b and d cannot be told apart by these data: only a + d and b - 2 d are determined"
    J, scale = columns(), np.array([1.0, 10.0, 1.0, 0.1])
    by_pivots = base_parameters(J * [1e3, 1e3, 1.0, 1.0])
    assert len(by_pivots.independent) == 3
    assert by_pivots.messages(NAMES)[0].startswith("a, b and d cannot be told apart by these data: only")
    directions = null_directions(J, scale)
    assert base_of_directions(directions, scale).messages(NAMES) == [sentence]
    assert dependencies(directions, scale, NAMES) == {"d": ["a", "b"]}
    point = LocalJacobian(J, np.array([1.0, 2.0, 3.0, 4.0]))
    (local,) = local_messages(NAMES, point, np.ones(4), None, lambda: None)
    assert local.replace(" (to first order)", "") == sentence


def test_columns_without_influence_and_groups_of_other_units():
    base = base_parameters(columns(idle=True) * [1e9, 1.0, 1.0, 1.0])
    assert base.silent(NAMES) == ("d",)
    assert base.messages(NAMES) == ["nothing that was measured depends on d"]
    pairs = np.repeat(columns()[:, :2], 2, axis=1) * [1e9, 1.0, 1.0, 1.0]
    assert [message.partition(":")[0] for message in base_parameters(pairs).messages(NAMES)] == [
        "a and b cannot be told apart by these data",
        "c and d cannot be told apart by these data",
    ]
    assert not base_of_directions(np.zeros((0, 4)), np.ones(4)).messages(NAMES)


@pytest.mark.parametrize(
    ("law", "determined"),
    [(lambda p: p[0] * p[1], "a * b"), (lambda p: p[0] / p[1], "a / b"), (lambda p: p[1] - p[0], "a - b")],
)
def test_a_law_of_two_is_seen_in_two_points(law, determined):
    t = np.linspace(0.1, 1.0, 9)

    def at(p, h=1e-6):
        ends = [np.exp(-t * law(p + s * h * e)) for e in np.eye(2) for s in (1, -1)]
        return LocalJacobian(np.column_stack([ends[0] - ends[1], ends[2] - ends[3]]) / (2 * h), p)

    point, other = at(np.array([1.0, 2.0])), at(np.array([1.1, 2.4]))
    found = local_messages(["a", "b"], point, np.ones(2), at(point.values, 2e-6), lambda: other)
    assert found == [f"a and b cannot be told apart by these data: only {determined} is determined"]
