"""Expressions are written with the right value, few parentheses, and what occurs often once."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gantrytau import Input, Model, ModelError, Parameter, Real, der, if_else, time, translate
from gantrytau.writing.collect import collected, moving_part
from gantrytau.writing.graph import Graph
from gantrytau.writing.modelica_syntax import ModelicaSyntax
from gantrytau.writing.subexpressions import written
from gantrytau.writing.text import PlainSyntax
from tests.writing.modelica_reader import Evaluator, plain, read_modelica
from tests.writing.residuals import assert_same_residuals

SYMBOLS = [ca.SX.sym(name) for name in "abc"]
A, B, C = SYMBOLS


def text_of(expression: ca.SX) -> str:
    return written(Graph().read([expression]), PlainSyntax()).expressions[0].text


def collected_text(*expressions: ca.SX) -> list[str]:
    graph = Graph()
    nodes = collected(graph, graph.read(expressions))
    return [one.text for one in written(nodes, PlainSyntax()).expressions]


def value_of(expression: ca.SX, values: dict[str, float], rewrite=lambda _, nodes: nodes) -> float:
    """The value of the Modelica text of an expression, as pymoca reads it."""
    graph = Graph()
    text = written(rewrite(graph, graph.read([expression])), ModelicaSyntax())
    equations = [*text.definitions, ("'result'", text.expressions[0].text)]
    lines = "\n".join(f"{left} = {right};" for left, right in equations)
    declared = "".join(f"Real {left};" for left, _ in equations)
    read = read_modelica(f"model X\n{declared}\nequation\n{lines}\nend X;\n")
    defined = {plain(e.left.name): e.right for e in read.tree.equations}
    return float(Evaluator(read, values, defined).name("result"))


UNARY = [
    lambda x: -x, lambda x: x**2, lambda x: 2 * x, lambda x: 1 / (x**2 + 1), ca.sin, ca.tanh, ca.fabs, ca.sign,
    lambda x: ca.sqrt(1 + x**2), lambda x: x**3, ca.floor, ca.atan, lambda x: -(2 * x), lambda x: x * 3 / 3,
]  # fmt: skip
BINARY = [
    lambda x, y: x + y, lambda x, y: x - y, lambda x, y: x * y, lambda x, y: x / (y**2 + 0.5), ca.fmin, ca.fmax,
    lambda x, y: ca.if_else(x < y, x, y * 2), lambda x, y: (x <= y) * x, ca.atan2, ca.hypot, ca.copysign,
    lambda x, y: ca.if_else(ca.logic_or(ca.logic_not(x < 1), y >= x), x, -y),
    lambda x, y: ca.if_else(ca.logic_and(x == y, x != 0), x, y), lambda x, y: x - (y - x), lambda x, y: -x / y**2,
]  # fmt: skip


STEPS = st.lists(st.tuples(*[st.integers(0, 40)] * 3), min_size=1, max_size=14)
POINT = {"a": 0.7, "b": -1.3, "c": 2.1}


def random_expression(steps) -> tuple[ca.SX, float, float]:
    """An expression, its value at POINT, and the largest number on the way there."""
    nodes = [A, B, C, ca.SX(-1.5), ca.SX(0.25)]
    for operation, first, second in steps:
        x, y = nodes[-1 - first % len(nodes)], nodes[-1 - second % len(nodes)]
        k = operation % (len(UNARY) + len(BINARY))
        nodes.append(UNARY[k](x) if k < len(UNARY) else BINARY[k - len(UNARY)](x, y))
    with np.errstate(all="ignore"):
        values = np.array(ca.Function("f", SYMBOLS, [ca.vertcat(*nodes)])(*POINT.values())).ravel()
    return nodes[-1], values[-1], np.abs(values).max()


@settings(max_examples=120, deadline=None, derandomize=True)
@given(STEPS)
def test_any_expression_keeps_its_value(steps):
    expression, expected, largest = random_expression(steps)
    if not largest < 1e6:  # numbers beyond it say nothing about the text
        return
    # rounding of reordered sums grows with the numbers in between, at most once per step
    assert value_of(expression, POINT) == pytest.approx(expected, rel=1e-12, abs=1e-13 * max(largest, 1.0))


@pytest.mark.parametrize(
    ("expression", "text"),
    [
        (0.25 * A + B + 0.25 * A, "0.5*a + b"),
        (A - (B - C) - A, "c - b"),
        (A - A + B * 0, "0"),
        (2 * A + 2 * B, "2*(a + b)"),
        (-0.5 * A - 0.5 * B, "-0.5*(a + b)"),
        (-3 * A / (6 * B), "-0.5*a/b"),
        ((A - 2 * B) / (4 * B - 2 * A), "-0.5"),
        (A * B + B * A, "2*a*b"),
        (0.9994 * (0.25 * A + 0.9994 * B) + 0.0293 * (0.0293 * B), "0.24985*a + 0.99965885*b"),
        (0.1 * A + 0.2 * A - 0.3 * A + B, "b"),  # 5e-17 is left of a
        (A - (B - ca.sin(A + C - A)), "a - b + sin(c)"),
        (ca.if_else(A + A > 0, B + B, C), "if 2*a > 0 then 2*b else c"),
        ((2 * A) ** 2, "4*a^2"),
        (-A - 2 * B, "-(a + 2*b)"),
    ],
)
def test_equal_terms_are_collected(expression, text):
    assert collected_text(expression) == [text]


def test_shared_sums_stay_shared_unless_their_terms_meet_their_like():
    long = A + 2 * B + 3 * C + ca.sin(A)
    assert collected_text(long, long * B, ca.cos(long) + C) == ["#1", "#1*b", "cos(#1) + c"]
    short = A + 0.25 * B
    assert collected_text(short / C, short + 0.25 * B) == ["(a + 0.25*b)/c", "0.5*b + a"]


@settings(max_examples=120, deadline=None, derandomize=True)
@given(STEPS)
def test_collected_expressions_keep_their_value(steps):
    expression, expected, largest = random_expression(steps)
    if not largest < 1e4:  # of larger numbers, the digits that are left say nothing
        return
    # numbers are collected to 14 digits
    found = value_of(expression, POINT, collected)
    assert found == pytest.approx(expected, rel=1e-10, abs=1e-11 * max(largest, 1.0))


@pytest.mark.parametrize(
    ("expression", "text"),
    [
        (A + B * C, "b*c"),
        ((A + ca.tanh(C / B) + C**2) / A, "(tanh(c/b) + c^2)/a"),
        (B * (A - C * A), "-b*c*a"),
        (ca.cos(C) + A, "cos(c) - cos(0)"),
        (A * B, "0"),
    ],
)
def test_what_the_rates_add_is_found_without_differences(expression, text):
    graph = Graph()
    nodes = moving_part(graph, graph.read([expression]), {"c"})
    assert written(nodes, PlainSyntax()).expressions[0].text == text


@pytest.mark.parametrize(
    ("expression", "text"),
    [
        (A + (B + C), "a + b + c"),
        (A - (B + C), "a - (b + c)"),
        (A - (B - C), "a - (b - c)"),
        (A - -B, "a + b"),
        (-A + B, "b - a"),
        (A * (B / C), "a*(b/c)"),
        (A / (B * C), "a/(b*c)"),
        (A / B / C, "a/b/c"),
        (-(A + B) * C, "-(a + b)*c"),
        ((B - A) ** 2, "(b - a)^2"),
        ((-A) ** 2.5, "(-a)^2.5"),
        (-(A**2), "-a^2"),
        (A ** (B + 1), "a^(b + 1)"),
        ((A**B) ** C, "(a^b)^c"),
        (A**-2.5, "a^(-2.5)"),
        (A * -2, "-2*a"),
        (1 / A, "1/a"),
        (A * A, "a^2"),
        (A * A**2, "a^3"),
        (ca.if_else(A > 0, B, C), "if a > 0 then b else c"),
        (C + ca.if_else(A > 0, B, C), "c + (if a > 0 then b else c)"),
        (
            ca.if_else(ca.logic_not(ca.logic_and(A < B, B <= C)), A, 0),
            "if not (a < b and b <= c) then a else 0",
        ),
        (1e-7 * A, "1e-07*a"),
    ],
)
def test_parentheses_stand_where_they_are_needed(expression, text):
    assert text_of(expression) == text


def test_all_operators_that_modelica_can_say():
    unary = [ca.exp, ca.log, ca.sqrt, ca.fabs, ca.sign, ca.sin, ca.cos, ca.tan, ca.atan]
    unary += [ca.sinh, ca.cosh, ca.tanh]
    unary += [ca.floor, ca.ceil, ca.asinh, ca.log1p, ca.expm1, lambda x: ca.acosh(1 + x), lambda x: 1 / x]
    unary += [lambda x: ca.asin(x / 3), lambda x: ca.acos(x / 3), lambda x: ca.atanh(x / 3)]
    binary = [ca.fmin, ca.fmax, ca.atan2, ca.fmod, ca.copysign, ca.hypot, ca.power, lambda x, y: (x < y) * x]
    binary += [lambda x, y: ca.if_else(x == y, x, y), lambda x, y: ca.if_else(x != y, x, -y)]

    class Everything(Model):
        x, y = Real(unit="1"), Input(unit="1", start=1.0)
        z = Real(len(unary) + len(binary), unit="1")

        def equations(self):
            yield der(self.x) == self.y - time
            values = [f(self.x) for f in unary] + [f(self.x, self.y) for f in binary]
            yield self.z == ca.vertcat(*values)

    assert_same_residuals(translate(Everything(x=dict(start=0.5)), units=False), lowest=0.1)


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (ca.erf, "found the function erf, expected one that Modelica has"),
        (lambda x: ca.remainder(x, 2), "found the function remainder, expected one that Modelica has"),
        (lambda x: ca.if_else(x > -5, x, ca.inf), "found an infinite number, which Modelica cannot write"),
    ],
)
def test_what_modelica_cannot_say_is_refused(function, words):
    class Unsaid(Model):
        x = Real(unit="1")
        y = Real(unit="1")

        def equations(self):
            yield der(self.x) == -self.x
            yield self.y == function(self.x)

    dae = translate(Unsaid(), units=False)
    with pytest.raises(ModelError, match=f"the model \\(Unsaid\\), equation 2: .*{words}"):
        dae.equations("base-modelica")
    for format in ("text", "latex", "html"):
        assert len(dae.equations(format)) > 100


def test_a_parameter_that_modelica_cannot_say_is_named():
    class Unsaid(Model):
        a = Parameter(1.0, unit="1")
        b = Parameter(lambda self: ca.erf(self.a), unit="1")

    with pytest.raises(ModelError, match=r"^b: found the function erf"):
        translate(Unsaid(), units=False).equations("base-modelica")


@pytest.mark.parametrize(
    ("expression", "words"),
    [(A.printme(3), "CasADi's operator number"), (A + np.nan, "found nan, expected finite")],
)
def test_what_has_no_mathematical_form_is_refused(expression, words):
    with pytest.raises(ModelError, match=words):
        Graph().read([expression])


def rotation(angle: ca.SX) -> ca.SX:
    c, s = ca.cos(angle), ca.sin(angle)
    return ca.vertcat(ca.horzcat(c, -s, 0), ca.horzcat(s * c, c * c, -s), ca.horzcat(s * s, c * s, c))


@pytest.mark.parametrize("syntax", [PlainSyntax(), ModelicaSyntax()], ids=["text", "modelica"])
def test_a_chain_of_orientations_is_written_in_linear_space(syntax):
    def size(joints: int) -> int:
        chain = ca.SX.eye(3)
        for k in range(joints):
            chain = chain @ rotation(ca.SX.sym(f"phi{k}"))
        text = written(Graph().read(chain.elements()), syntax)
        return sum(len(value) for _, value in text.definitions) + sum(len(e.text) for e in text.expressions)

    # written out without names it would grow as 3^joints
    assert size(40) < 2.5 * size(20)


def test_graphs_deeper_than_the_recursion_limit_are_written():
    deep = A
    for _ in range(3000):
        deep = ca.sin(deep) + B
    assert len(text_of(deep)) > 3000


class Chain(Model):
    """A product of rotations in equations of its own, large enough to be shared."""

    phi = Real(4, unit="rad", start=[0.1, 0.2, 0.3, 0.4], fixed=True)
    speed = Parameter(1.0, unit="1/s")
    r = Real(3, unit="1")
    n = Real(3, unit="1")

    def equations(self):
        turned = ca.SX.eye(3)
        for k in range(4):
            turned = turned @ rotation(self.phi[k])
        yield der(self.phi) == -self.speed * self.phi
        yield self.r == turned @ ca.DM([1, 2, 3])
        yield self.n == if_else(self.phi[0] > 0, turned[:, 0], turned[:, 2])


def test_shared_subexpressions_become_variables_of_the_modelica_text():
    read = assert_same_residuals(translate(Chain(), units=False))
    assert "1" in read.symbols
