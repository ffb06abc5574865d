"""The page of equations says what the model says: every formula is read back and computed at random numbers."""

import re

import casadi as ca
import numpy as np
import pytest

from gantrytau import (
    Array,
    Dae,
    Discrete,
    Model,
    Parameter,
    Real,
    delay,
    der,
    if_else,
    pre,
    reinit,
    sampled,
    sin,
    table,
    translate,
    when,
)
from gantrytau.language.symbols import split_derivative
from gantrytau.mechanics.translational import LinearFriction
from gantrytau.writing.equations_page.wrapping_formulas import html_name
from gantrytau.writing.excerpt import excerpt
from gantrytau_models import FourBar, GantryTau, Pendulum, SixLinkGantryTau, prototypes
from tests.writing.page_reader import PageOfEquations
from tests.writing.test_readable import Named, Rotor

AS_WRITTEN, SOLVED = "By component, as written", "In the order of solution"


class Numbers(dict[str, np.ndarray | float]):
    """Random numbers by name, made when asked for: of scalars, vectors, derivatives."""

    def __init__(self, dae: Dae):
        self.dae, self.generator = dae, np.random.default_rng(1)

    def __missing__(self, name: str):
        base, order = split_derivative(name)
        whole = self.dae.flat.vectors.get(base)
        if whole is not None and whole.shape:
            elements = [self["der(" * order + n + ")" * order] for n in whole.elements]
            return np.array(elements)
        assert base in self.dae.flat.scalars, name
        self[name] = float(self.generator.uniform(0.5, 2.0))
        return self[name]

    def of(self, *expressions: ca.SX) -> np.ndarray:
        """The values of expressions."""
        vector = ca.densify(ca.SX(ca.vertcat(*expressions)))
        leaves = ca.symvar(vector)
        function = ca.Function("f", [ca.vertcat(*leaves)], [vector])
        return np.array(function(ca.DM([self[leaf.name()] for leaf in leaves]))).ravel()


def close(found, expected) -> bool:
    """Within what rounding leaves of sums in another order, whose terms are up to a thousand, at 14 digits."""
    return np.allclose(found, expected, rtol=1e-9, atol=1e-10, equal_nan=True)


def assert_says_the_same(dae: Dae) -> PageOfEquations:
    page, numbers, found = PageOfEquations(dae.equations("html")), Numbers(dae), excerpt(dae)
    parts = {part.mark: page.values(part, numbers) for part in page.parts[SOLVED] if part.mark}
    assert list(parts) == [f"b{s.number}" for s in found.sections] + ["so that"] * bool(found.answers)
    for section in found.sections:
        lines = parts[f"b{section.number}"]
        expected = numbers.of(*(line.right for line in section.lines))
        assert len(lines) == len(expected)
        for line, value, (formula, _, right) in zip(section.lines, expected, lines, strict=True):
            assert formula.left == ("0" if line.left is None else f"N[{line.left!r}]")
            assert close(right, value), (formula, right, value)
    for (name, expression), (formula, _, right) in zip(found.answers, parts.get("so that", ()), strict=True):
        assert formula.left == f"N[{name!r}]"
        assert close(right, numbers.of(expression)), (formula, right)
    written = [row for part in page.parts[AS_WRITTEN] for row in page.values(part, numbers)]
    residuals = np.concatenate([np.atleast_1d(left - right) for _, left, right in written] or [np.zeros(0)])
    stated = [*found.equations, *(() if found.wanted else dae.flat.initial_equations)]
    expected = numbers.of(*(e.residual for e in stated)) if stated else np.zeros(0)
    assert close(np.sort(residuals), np.sort(expected))
    return page


MODELS = {
    "pendulum": Pendulum,
    "names": Named,
    "four bars": FourBar,
    "three links": lambda: GantryTau(prototypes.L1, friction=LinearFriction),
    "six links": lambda: SixLinkGantryTau(prototypes.D1),
}


@pytest.mark.parametrize("name", MODELS)
def test_all_formulas_have_the_values_of_the_model(name):
    assert_says_the_same(translate(MODELS[name](), units=name != "names"))


class Switching(Model):
    """What is set at instants, piecewise, of the past, matrices, formulas of parameters, awkward names and words."""

    h = Real(unit="m", start=1.0, fixed=True, description="<script>alert('height')</script> & \"more\"")
    v = Real(unit="m/s", start=0.0, fixed=True)
    e = Parameter(0.8, unit="1")
    twice = Parameter(lambda self: 2 * self.e, unit="1", description="formula")
    bounces = Discrete(start=0.0, unit="1")
    held = Real(unit="m", start=0.0)
    past = Real(unit="m")
    t, c = Real(unit="1"), Real(unit="1")
    größe = Real(unit="1")
    R = Real((2, 3), unit="1")
    M = Parameter([[1, 2, 3], [4, 5, 6]], unit="1")
    parts = Array(Rotor, 2)

    def equations(self):
        yield self.v == der(self.h)
        yield der(self.v) == -9.81
        yield when(self.h <= 0, reinit(self.v, -self.e * pre(self.v)), self.bounces == pre(self.bounces) + 1)
        yield sampled(self.held, self.h * self.twice, period=0.1)
        yield self.past == delay(self.h, 0.25) + self.held
        yield self.t == table(self.h, [0, 1, 2, 3], [0, 1, 4, 9], kind="spline")
        yield self.c == if_else(self.h > 1, if_else(self.v < 0, sin(self.h), 2.0), ca.fabs(self.h) ** 1.5)
        yield self.größe == self.t / (1 + self.c) + self.bounces
        yield self.R == self.M * self.größe + self.M

    def initial_equations(self):
        yield self.parts[0].phi == 2 * self.parts[1].phi + 1


@pytest.fixture(scope="module")
def switching():
    return translate(Switching(), events=True, units=False)


def test_formulas_that_switch_have_the_values_of_the_model(switching):
    assert_says_the_same(switching)


def test_words_of_users_are_words_on_the_page(switching):
    text = switching.equations("html")
    assert text.count("<script>") == 1  # its own
    assert "&lt;script&gt;alert('height')&lt;/script&gt; &amp;" in text


@pytest.mark.parametrize(
    "find", [["R"], ["past", "twice"], ["c", "der(v)"], ["parts[1].w", "der(parts[1].w)"], ["M"], ["time"]]
)
def test_what_is_cut_has_the_values_of_the_model(find):
    dae = translate(Switching(), events=True, units=False, find=find)
    page = assert_says_the_same(dae)
    assert len(page.parts[SOLVED]) < len(translate(Switching(), events=True, units=False).blocks)


def wanted_from(dae: Dae, known: dict[str, float]) -> dict[str, float]:
    """What follows from numbers of what is known, by the sections alone, which have to suffice."""
    found, values = excerpt(dae), {**dae.parameter_values, **known}
    for section in found.sections:
        assert section.single
        values[section.unknowns[0]] = float(value_at(section.lines[0].right, values))
    values |= {name: float(value_at(e, values)) for name, e in found.answers}
    return {name: values[name] for name in found.wanted}


def value_at(expression: ca.SX, values: dict[str, float]) -> ca.DM:
    leaves = ca.symvar(expression)
    return ca.Function("f", [ca.vertcat(*leaves)], [expression])(ca.DM([values[x.name()] for x in leaves]))


def test_an_inverse_kinematics_is_one_line_for_each_cart():
    carts = [f"carts[{k}].s" for k in range(3)]
    dae = translate(GantryTau(prototypes.GT_A), given=["tool.r"], find=carts)
    tool = [0.5, 3.0, -0.6]
    known = {f"tool.r[{k}]": x for k, x in enumerate(tool)}
    expected = dae.function(["tool.r"], carts)(tool)
    # the same formulas, rounded in another order
    assert list(wanted_from(dae, known).values()) == pytest.approx([float(x) for x in expected], abs=1e-12)
    text = dae.equations()
    assert len([line for line in text.splitlines() if line.startswith("[")]) == 3
    assert "3 of 55 blocks; the others do not matter for what is wanted" in text
    assert len(dae.equations("html")) < 30_000
    assert dae.equations("base-modelica").count("\n") > 500  # whole


def test_speeds_and_orientations_that_are_wanted_follow_from_what_is_written():
    find = ["der(tool.r)", "arms[0].link.frame_a.r", "tool.frame.R"]
    dae = translate(GantryTau(prototypes.L1), given=["tool.r"], find=find)
    tool = {f"tool.r[{k}]": x for k, x in enumerate([0.5, 3.0, -0.6])}
    tool |= {f"der({name})": 0.1 for name in tool}
    found = wanted_from(dae, tool)
    expected = dae.evaluate(dict(zip(("tool.r", "der(tool.r)"), ([0.5, 3.0, -0.6], [0.1] * 3), strict=True)))
    for name in find:
        numbers = np.ravel(expected[name], order="F")
        assert [found[n] for n in dae.expand(name)] == pytest.approx(list(numbers), abs=1e-9), name


@pytest.mark.parametrize(
    ("find", "words"),
    [
        (["h"], "wanted: h (a state)"),
        (["held"], "wanted: held (set at instants)"),
        (["time"], "wanted: time (known)"),
        (["e", "twice"], "so that\n      e = 0.8\n      twice = 2*e\n"),
        (["past"], "delayed: delay(h, 0.25) = h, 0.25 s ago"),
        (["held"], "sampled: held = h*twice    # every 0.1 s, from the model"),
    ],
)
def test_what_is_wanted_is_told_where_no_block_gives_it(find, words):
    assert words in translate(Switching(), events=True, units=False, find=find).equations()


def test_all_six_states_of_the_six_links_are_on_the_page_once():
    page = translate(SixLinkGantryTau(prototypes.D1)).equations("html")
    assert "<dt>6 states</dt>" in page
    assert "<b>states</b>: 2, 6 scalars" in page or "<b>states</b>: 6<" in page
    # the target of the page, in bytes
    assert len(page.encode()) <= 300_000


def test_speeds_without_a_name_of_their_own_are_told_with_their_positions():
    class Falling(Model):
        x = Real(unit="m", start=1.0, fixed=True)

        def equations(self):
            yield der(self.x, 2) == -9.81

    page = PageOfEquations(translate(Falling()).equations("html"))
    (row,) = page.quantities.values()
    assert row.cells[:4] == ("x", "m", "", "state, with its derivative")
    assert "states: 2" in page.summaries


def test_models_without_equations_have_a_page():
    class Still(Model):
        p = Parameter(2.0, unit="m", description="a length")

    for find in ((), ("p",)):
        page = PageOfEquations(translate(Still(), find=find).equations("html"))
        assert [row.cells for row in page.quantities.values()] == [("p", "m", "a length", "", "2")]


def test_names_are_typeset_by_letters():
    assert html_name("der(der(arm.phi1))") == "arm.φ\u0308₁"
    assert html_name("der(kinetic_energy)") == "<b>d/dt</b>\u00a0kinetic_energy"
    assert html_name("arms[2].w[0]") == "arms[2].ω₀"
    assert html_name("R[0,1]") == "R<sub>0,1</sub>"
    assert html_name("v_x") == "v<sub>x</sub>"
    assert html_name("a_long_name_of_many") == "a_long_name_of_many"


def test_wide_formulas_have_spaces_to_be_broken_at():
    text = translate(SixLinkGantryTau(prototypes.D1)).equations("html")
    for formula in re.findall(r"<math>.*?</math>", text):
        assert len(re.sub("<[^>]*>", "", formula)) < 150  # letters in numerator and denominator, side by side


def test_what_is_a_multiple_of_a_state_is_told_as_it_was_written():
    class Geared(Model):
        a = Real(start=1.0)
        b, c, beside = Real(), Real(), Real()

        def equations(self):
            yield self.b == 2 * self.a
            yield self.c == -self.b
            yield self.beside == 3 * self.a
            yield der(self.a) == -self.a

    found = excerpt(translate(Geared(), find=["c"]))
    assert [e.name for e in found.equations] == [f"the model (Geared), equation {k}" for k in (1, 2)]
