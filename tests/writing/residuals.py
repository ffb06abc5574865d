"""Compares the equations of a Dae's flat Modelica text, read by an independent parser, with its flat model."""

import casadi as ca
import numpy as np

from gantrytau import Dae, Model, translate
from gantrytau.language.symbols import derivative_name, split_derivative
from gantrytau.writing.base_modelica import independent_equations
from tests.writing.modelica_reader import Evaluator, ModelicaClass, plain, read_by_lines


def assert_same_residuals(
    model: Model | Dae, *, seed: int = 1, lowest: float = -2.0, points: int = 2
) -> ModelicaClass:
    """The text is balanced and its equations have the residuals of the flat model at random points.

    lowest: the least of the random values, which reach to 2; positive for models with roots or logarithms; points:
    one tells smooth equations apart, more are for the branches of `if`.
    """
    dae = model if isinstance(model, Dae) else translate(model)
    read = read_by_lines(dae.equations("base-modelica"))
    assert len(read.unknowns) == len(read.tree.equations)
    assert set(read.named("input")) == set(dae.known)
    assert set(read.named("parameter")) == set(dae.parameters)
    generator = np.random.default_rng(seed)
    for _ in range(points):
        _assert_same_at(dae, read, generator, lowest)
    return read


def _assert_same_at(dae: Dae, read: ModelicaClass, generator: np.random.Generator, lowest: float) -> None:
    flat = dae.flat
    kept = independent_equations(dae)
    written = (*kept, *flat.initial_equations)
    sides = ca.SX(ca.vertcat(*(side for e in written for side in (e.left, e.right))))
    symbols = ca.symvar(ca.SX(ca.vertcat(sides, *flat.definitions.values(), *flat.derivatives.values())))
    orders = dict.fromkeys((*(n for v in flat.variables for n in v.elements), "time"), 0)
    for name, order in map(split_derivative, (*(s.name() for s in symbols), *dae.request.find)):
        orders[name] = max(orders.get(name, 0), order)
    values = {
        derivative_name(n, k): generator.uniform(lowest, 2)
        for n, top in orders.items()
        for k in range(top + 1)
    }
    values |= dae.table.values
    left = dict(flat.definitions)
    while left:  # each uses others, in whatever order they stand
        ready = {n: e for n, e in left.items() if not any(s.name() in left for s in ca.symvar(e))}
        assert ready
        values |= {n: float(_numbers(e, values)[0]) for n, e in ready.items()}
        left = {n: e for n, e in left.items() if n not in ready}
    expected = _numbers(sides, values)
    others = read.tree.equations[len(kept) :]
    said = {*dae.parameters, *flat.definitions}  # they have the values that the text gives them
    variables = {n: v for n, v in values.items() if n not in said}
    evaluate = Evaluator(read, variables, {plain(e.left.name): e.right for e in others})
    equations = [*read.tree.equations[: len(kept)], *read.tree.initial_equations]
    for number, (equation, one) in enumerate(zip(equations, written, strict=True)):
        assert equation.comment == one.name
        left, right = expected[2 * number], expected[2 * number + 1]
        found = evaluate(equation.left) - evaluate(equation.right)
        # rounding of sums in another order, relative to the sizes of the two sides and of their terms, about 10
        assert abs(found - (left - right)) <= 1e-12 * max(abs(left), abs(right), 10.0), one.name
    for name in said:
        assert abs(evaluate.name(name) - values[name]) <= 1e-12 * max(abs(values[name]), 10.0), name
    for equation in others:
        assert evaluate(equation.left) == evaluate(equation.right), str(equation.left)


def _numbers(expressions: ca.SX, values: dict[str, float]) -> np.ndarray:
    symbols = ca.symvar(expressions)
    function = ca.Function("numbers", [ca.vertcat(*symbols)], [ca.densify(expressions)])
    return np.array(function(ca.DM([values[s.name()] for s in symbols]))).ravel()
