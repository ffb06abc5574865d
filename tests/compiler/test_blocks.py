"""Pairings, blocks, tearing and elimination on random systems with known solutions."""

import itertools

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gantrytau.compiler.blocks.pattern import block_pattern
from gantrytau.compiler.blocks.pivots import Guide
from gantrytau.compiler.blocks.solution import solve_blocks
from gantrytau.compiler.dulmage_mendelsohn import decompose, largest_sum
from gantrytau.language.symbols import Derivative, derivatives_in


def incidence_of(residuals):
    return {key: derivatives_in(residual) for key, residual in residuals.items()}


FIXED = settings(derandomize=True, deadline=None, max_examples=60)


@FIXED
@given(st.integers(1, 5), st.integers(0, 2**32 - 1), st.floats(0.2, 1.0))
def test_largest_sum_is_that_of_the_best_pairing(n, seed, density):
    random = np.random.default_rng(seed)
    rows = [{j: int(random.integers(0, 3)) for j in range(n) if random.random() < density} for _ in range(n)]
    sums = [
        sum(row[j] for row, j in zip(rows, order, strict=True))
        for order in itertools.permutations(range(n))
        if all(j in row for row, j in zip(rows, order, strict=True))
    ]
    matched = largest_sum(rows)
    if matched is None:
        assert not sums
        assert decompose(rows, n).surplus
    else:
        assert sorted(matched) == list(range(n))
        assert sum(row[j] for row, j in zip(rows, matched, strict=True)) == max(sums)


@FIXED
@given(st.integers(1, 8), st.integers(0, 2**32 - 1))
def test_blocks_are_mutually_reachable_and_in_order(n, seed):
    random = np.random.default_rng(seed)
    graph = [[j for j in range(n) if j != i and random.random() < 0.25] for i in range(n)]
    reach = (
        np.linalg.matrix_power(np.eye(n) + np.array([[j in row for j in range(n)] for row in graph]), n) > 0
    )
    names = [f"x{i}" for i in range(n)]
    incidence = {(i, 0): [Derivative(names[j], 0) for j in (i, *row)] for i, row in enumerate(graph)}
    pattern = block_pattern(incidence, names)
    assert sorted(i for equations, _ in pattern.blocks for i, _ in equations) == list(range(n))
    assert all([names[i] for i, _ in equations] == list(unknowns) for equations, unknowns in pattern.blocks)
    place = {i: k for k, (equations, _) in enumerate(pattern.blocks) for i, _ in equations}
    for i, j in itertools.product(range(n), repeat=2):
        assert (place[i] == place[j]) == (reach[i, j] and reach[j, i])
        if reach[i, j]:
            assert place[j] <= place[i]
    wanted = block_pattern(incidence, names, [names[0]])
    assert {i for equations, _ in wanted.blocks for i, _ in equations} == set(np.flatnonzero(reach[0]))


@FIXED
@given(st.integers(1, 6), st.integers(1, 6), st.integers(0, 2**32 - 1), st.floats(0.1, 0.6))
def test_decomposition_counts_what_a_random_matrix_leaves_free(n, m, seed, density):
    random = np.random.default_rng(seed)
    pattern = random.random((n, m)) < density
    # generic numbers: the structural rank
    rank = np.linalg.matrix_rank(pattern * random.uniform(1, 2, (n, m)))
    found = decompose([np.flatnonzero(row).tolist() for row in pattern], m)
    assert (len(found.surplus), len(found.free)) == (n - rank, m - rank)
    for column in range(m):  # a column is undetermined if the others alone have the same rank
        rest = np.delete(pattern, column, axis=1) * random.uniform(1, 2, (n, m - 1))
        assert (column in found.undetermined) == (np.linalg.matrix_rank(rest) == rank)


@FIXED
@given(st.integers(1, 14), st.integers(0, 2**32 - 1), st.floats(0.05, 0.5))
def test_sparse_linear_systems_are_solved_to_their_condition(n, seed, density):
    random = np.random.default_rng(seed)
    matrix = np.where(random.random((n, n)) < density, random.normal(size=(n, n)), 0.0)
    matrix += np.diag(random.choice([-1.0, 1.0], n) * random.uniform(0.5, 2.0, n))
    matrix = matrix[random.permutation(n)]
    expected = random.normal(size=n)
    right = matrix @ expected
    x = [ca.SX.sym(f"x{k}") for k in range(n)]
    u = ca.SX.sym("u")  # the coefficients are symbols, as parameters would be
    residuals = {
        (i, 0): u * sum((matrix[i, j] * x[j] for j in range(n) if matrix[i, j]), ca.SX(0)) - right[i]
        for i in range(n)
    }
    symbols = {s.name(): s for s in x}
    pattern = block_pattern(incidence_of(residuals), symbols)
    assert not pattern.undetermined
    assert not pattern.surplus
    start = {**dict.fromkeys(symbols, 0.0), "u": 1.0}
    blocks = solve_blocks(pattern.blocks, residuals, symbols, Guide(start, {"u"}, ()))
    if blocks.implicit:
        assert n > 12 or np.linalg.cond(matrix) > 1e6
        return
    found = blocks.after(()).inserted(x)
    numbers = np.ravel(ca.evalf(ca.substitute(ca.vertcat(*found), u, 1.0))).astype(float)
    # unrolled elimination with pivots of a tenth of their row: a growth of ten per step, seldom reached
    np.testing.assert_allclose(numbers, expected, atol=1e-12 * max(10.0, np.linalg.cond(matrix)))


def test_undetermined_and_surplus_parts_are_told_apart():
    a, b, c, d = (ca.SX.sym(n) for n in "abcd")
    residuals = {(0, 0): a - 1, (1, 0): a + 2, (2, 0): b + c, (3, 0): d * d - 4}
    pattern = block_pattern(incidence_of(residuals), "abcd")
    assert set(pattern.undetermined) == {"b", "c"}
    assert len(pattern.surplus) == 1
    assert pattern.surplus[0] in {(0, 0), (1, 0)}
    wanted = block_pattern(incidence_of(residuals), "abcd", ["d"])
    assert [unknowns for _, unknowns in wanted.blocks] == [("d",)]


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_quadratic_takes_the_branch_of_the_start(side):
    x, c = ca.SX.sym("x"), ca.SX.sym("c")
    residuals = {(0, 0): 2 * x**2 - 4 * x + c}
    guide = Guide({"x": 1.0 + side, "c": -6.0}, (), ())
    (block,) = solve_blocks([(((0, 0),), ("x",))], residuals, {"x": x}, guide).blocks
    assert block.kind == "quadratic"
    assert block.solution is not None
    found = ca.substitute(block.solution[0], c, -6.0)
    assert float(ca.evalf(found)) == pytest.approx(1.0 + 2.0 * side, rel=1e-15)


@pytest.mark.parametrize("slide", [(1.0, 1.0), (1.0, 0.0), (0.0, 1.0), (0.0, 0.0)])
def test_pivots_that_jump_with_modes_are_not_divided_by(slide):
    """Two coupled masses, each pulled by 2 N against friction of 0.3 N in terms of the path of its characteristic."""
    a, f, path, mode = (ca.SX.sym(n, 2) for n in ("a", "f", "path", "mode"))
    coupling = ca.DM([[2.0, 1.0], [1.0, 2.0]])
    laws = (coupling @ a + f - 2, f - ca.if_else(mode, 0.3, path), a - ca.if_else(mode, path - 0.3, 0))
    rows = ca.vertcat(*laws).elements()
    residuals = {(k, 0): row for k, row in enumerate(rows)}
    symbols = {s.name(): s for s in ca.vertcat(a, f, path).elements()}
    modes = {m.name(): 1.0 for m in mode.elements()}
    guide = Guide(dict.fromkeys(symbols, 0.0) | modes, (), (), modes=modes)
    solved = solve_blocks([(tuple(residuals), tuple(symbols))], residuals, symbols, guide)
    moving, *_ = solved.after(()).inserted([a])
    found = np.ravel(ca.evalf(ca.substitute(moving, mode, ca.DM(slide))))
    free = np.flatnonzero(slide)
    expected = np.zeros(2)
    expected[free] = np.linalg.solve(np.array(coupling)[np.ix_(free, free)], np.full(free.size, 1.7))
    np.testing.assert_allclose(found, expected, atol=1e-15)
