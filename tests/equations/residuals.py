"""Compares the equations of a Dae's flat Modelica text, read by an independent parser, with its flat model."""

import casadi as ca
import numpy as np

from gantrytau import Dae, Model, translate
from gantrytau.symbols import derivative_name, split_derivative
from tests.equations.modelica_reader import Evaluator, ModelicaClass, plain, read_modelica

POINTS = 3


def assert_same_residuals(model: Model | Dae, *, seed: int = 1, lowest: float = -2.0) -> ModelicaClass:
    """The text is balanced and its equations have the residuals of the flat model at random points.

    lowest: the least of the random values, which reach to 2; positive for models with roots or logarithms.
    """
    dae = model if isinstance(model, Dae) else translate(model)
    read = read_modelica(dae.equations("modelica"))
    assert len(read.unknowns) == len(read.tree.equations)
    assert set(read.named("input")) == set(dae.known)
    assert set(read.named("parameter")) == set(dae.parameters)
    generator = np.random.default_rng(seed)
    for _ in range(POINTS):
        _assert_same_at(dae, read, generator, lowest)
    return read


def _assert_same_at(dae: Dae, read: ModelicaClass, generator: np.random.Generator, lowest: float) -> None:
    flat = dae.flat
    redundant = {id(e) for e in dae.reduced.redundant}
    kept = [e for e in flat.equations if id(e) not in redundant]
    written = (*kept, *flat.initial_equations)
    sides = ca.vertcat(*(side for e in written for side in (e.left, e.right)), *flat.definitions.values())
    names = [n for v in flat.variables for n in v.elements]
    symbols = ca.symvar(ca.SX(ca.vertcat(sides, *flat.derivatives.values())))
    orders = dict.fromkeys((*names, "time"), 0)
    for name, order in (split_derivative(s.name()) for s in symbols):
        orders[name] = max(orders.get(name, 0), order)
    values = {
        derivative_name(n, k): generator.uniform(lowest, 2)
        for n, top in orders.items()
        for k in range(top + 1)
    }
    values |= dae.table.values
    function = ca.Function("sides", [ca.vertcat(*symbols)], [ca.densify(ca.SX(sides))])
    expected = np.array(function(ca.DM([values[s.name()] for s in symbols]))).ravel()
    others = read.tree.equations[len(kept) :]
    variables = {
        n: v for n, v in values.items() if n not in dae.parameters
    }  # parameters have what the text says
    evaluate = Evaluator(read, variables, {plain(e.left.name): e.right for e in others})
    equations = [*read.tree.equations[: len(kept)], *read.tree.initial_equations]
    for number, (equation, one) in enumerate(zip(equations, written, strict=True)):
        assert equation.comment == one.name
        left, right = expected[2 * number], expected[2 * number + 1]
        found = evaluate(equation.left) - evaluate(equation.right)
        # rounding of sums in another order, relative to the sizes of the two sides and of their terms, about 10
        assert abs(found - (left - right)) <= 1e-12 * max(abs(left), abs(right), 10.0), one.name
    for name, value in zip(flat.definitions, expected[2 * len(written) :], strict=True):
        assert abs(evaluate.name(name) - value) <= 1e-12 * max(abs(value), 10.0), name
    for equation in others:
        assert evaluate(equation.left) == evaluate(equation.right), str(equation.left)
