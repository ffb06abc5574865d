"""What a model states of instants at which a condition becomes true: its records, one round of them, and what is refused."""

from typing import Any

import casadi as ca
import pytest

from gantrytau import (
    Array,
    Discrete,
    Input,
    Model,
    ModelError,
    Parameter,
    Real,
    Start,
    StructureError,
    between,
    check,
    der,
    flatten,
    limit,
    linearize,
    logic_and,
    logic_not,
    logic_or,
    mod,
    pre,
    reinit,
    sampled,
    simulate,
    terminate,
    time,
    translate,
    when,
)
from gantrytau.flattening.whens import one_round
from tests.simulation.balls import Ball


def falling(*lines: str, **members):
    """A ball without a floor, whose equations end in more statements, evaluated with its names at hand."""

    def equations(self):
        yield der(self.h) == self.v
        yield der(self.v) == -self.g
        for line in lines:
            yield eval(line, {**globals(), "self": self, "sampled": sampled})

    return type(
        "Faulty", (Ball,), {"__doc__": "A ball.", "bounces": None, **members, "equations": equations}
    )()


def refused(*lines: str, kind: type[Exception] = ModelError, **members) -> str:
    with pytest.raises(kind) as error:
        translate(falling(*lines, **members), events=True)
    return str(error.value)


COUNT: dict[str, Any] = dict(n=Discrete(0, description="count"))


def test_records_of_a_ball():
    flat = flatten(Ball())
    (one,) = flat.whens
    assert flat.discretes == flat.event_names == ("bounces",)
    assert [name for name, _ in one.reinits] == ["v"]
    assert [name for name, _ in one.assignments] == ["bounces"]
    assert {leaf.name() for leaf in ca.symvar(one.reinits[0][1])} == {"e", "v"}  # pre(v) is v, just before
    assert {leaf.name() for leaf in ca.symvar(one.assignments[0][1])} == {"pre(bounces)"}
    assert one.label == "the model (Ball), equation 3, when((h<=0))"
    dae = translate(Ball(), events=True)
    assert dae.known == ("bounces",)
    assert dae.inputs == ()
    assert set(dae.states) == {"h", "v"}


class Chain(Model):
    """Discretes that need each other's new values, in the other order than they are written, and a chain."""

    x = Real(start=0.0, fixed=True)
    a = Discrete(1)
    b = Discrete([2, 3])
    c = Discrete(0)

    def equations(self):
        yield der(self.x) == 1 + self.a
        yield when(
            self.x > 1, self.a == self.b[0] + pre(self.b[1]), self.b == 10 * pre(self.b), self.c == 1
        ).elsewhen(self.x > 0.5, self.c == 2)


@pytest.mark.parametrize(
    ("rose", "acts", "found"),
    [
        ([0, 0], [0, 0], [1, 2, 3, 0]),
        ([1, 0], [1, 0], [20 + 3, 20, 30, 1]),
        ([0, 1], [0, 1], [1, 2, 3, 2]),
        ([1, 1], [1, 0], [20 + 3, 20, 30, 1]),
    ],
)
def test_a_round_in_sorted_order(rose, acts, found):
    flat = flatten(Chain())
    made = one_round(flat)
    old = [s for v in flat.variables if v.kind == "discrete" for s in v.symbol.elements()]
    assert flat.discretes == ("a", "b[0]", "b[1]", "c")
    function = ca.Function("round", [made.rose, ca.vertcat(*old)], [made.acts, made.discretes])
    after = [m.full().ravel().tolist() for m in function(rose, [1, 2, 3, 0])]
    assert after == [acts, found]


CONDITIONS = {
    "self.h": "found `h` as a condition of when, a number, expected a comparison, as x > 0",
    "self.h + self.v * 2": "a number, expected a comparison",
    "logic_and(self.h, self.v < 0)": "found `h` as a condition of when, a number",
    "self.h == 0": "found the equation `(h==0)` as a condition of when, which h meets at single instants only",
    "logic_or(self.v > 0, self.h == 0)": "found the equation `(h==0)`",
    "ca.vertcat(self.h, self.v) < 0": "the condition of when has shape (2, 1), expected one number",
    "True": "found True as the condition of when, which never changes",
    "self.g > 0": "found `(0<g)` as the condition of when, which never changes",
    "self.h < self.h": "which never changes",
    "'h < 0'": "found str as the condition of when, expected a comparison",
    "self.h < 0 and self.v < 0": "logic_and, logic_or, logic_not",
    "self.h < self.v": "units disagree",
}


@pytest.mark.parametrize("condition", CONDITIONS)
def test_what_is_no_condition(condition):
    text = refused(f"when({condition}, terminate('down'))")
    assert CONDITIONS[condition] in text
    assert "the model (Faulty), equation 3" in text


ACTIONS = {
    "": "found no action in when, expected reinit(...), discrete == ..., or terminate(...)",
    "reinit(self.g, 1.0)": "found g, declared as parameter, expected a variable declared as Real or Output",
    "reinit(self.n, 1.0)": "found reinit(n, ...), a Discrete, expected a state; write n == ...",
    "reinit(der(self.v), 1.0)": "found reinit(der(v), ...), a derivative, expected a variable",
    "reinit(2 * self.v, 1.0)": "reinit: found '(2.*v)', expected a variable",
    "reinit(self.v, ca.SX([1, 2]))": "the value of reinit has shape (2, 1), expected (1, 1)",
    "reinit(self.v, self.h), self.n == 1": "units disagree",
    "self.v == 0": "with v on its left, expected a Discrete there; a state gets another value by reinit",
    "pre(self.n) + 1 == self.n": "with `(pre(n)+1)` on its left, expected a Discrete there",
    "when(self.v < 0, self.n == 1)": "found WhenChain as an action of when",
    "terminate('')": "terminate: found '', expected a text",
    "self.n == 1, self.n == 2": "found two actions that set n in one when",
    "self.n == pre(pre(self.n))": "found pre(n), a value just before, expected a variable",
    "self.n == self.n + 1": "n needs its own new value, expected values that follow one after another; write pre(n)",
    "3": "found int, expected an equation",
}


@pytest.mark.parametrize("action", ACTIONS)
def test_what_is_no_action(action):
    lines = (f"when(self.h < 0, {action})", "when(self.h < -1, self.other == 1)")
    text = refused(*lines, other=Discrete(0), **COUNT)
    assert ACTIONS[action] in text
    assert "equation 3" in text


SET = "when(self.h < 0, self.n == 1)"
MEMBERS: dict[str, Any] = dict(
    n=Discrete(0), m=Discrete(0), x=Real(), y=Real(), z=Real(unit="m"), w=Real(unit="m/s"), u=Input(start=0.0)
)
STATEMENTS = [  # names of MEMBERS, statements behind two equations, and what is said of them
    (
        "nm",
        ["when(self.h < 0, self.n == self.m, self.m == 1 - self.n)"],
        "need each other's new values in a circle",
    ),
    (
        "n",
        [SET, "when(self.v < 0, self.n == 2)"],
        "4, when((v<0)): found n, which the model (Faulty), equation 3, when(",
    ),
    ("", ["when(self.h < 0, reinit(self.v, 1))", "when(self.v < 0, reinit(self.v, 2))"], "found v, which"),
    ("n", [], "n: found a Discrete that no when sets"),
    ("", ["self.h > 0"], "expected an equation"),
    ("ny", ["self.y == der(self.n)", SET], "der(): found n, which jumps at instants"),
    ("ny", ["self.y == der(self.h * self.n)", SET], "der(): found n"),
    ("z", ["self.z == pre(self.h)"], "equation 3: found pre(h), expected it in when(...) only"),
    ("z", ["sampled(self.z, pre(self.h), period=0.1)"], "found pre(h), expected it in when(...) only"),
    (
        "nz",
        ["sampled(self.z, self.h, period=0.1)", "when(self.h < 0, self.n == pre(self.z))"],
        "pre(z) of a sampled",
    ),
    (
        "y",
        ["self.y == 2 * self.h * self.v", "when(self.h < 0, reinit(self.y, 1))"],
        "y is no state, as it follows",
    ),
    ("u", ["when(self.h < 0, reinit(self.u, 1))"], "found u, declared as input"),
    (
        "w",
        [
            "self.w == -2 * self.v",
            "when(self.h < 0, reinit(self.w, 1))",
            "when(self.h < -1, reinit(self.v, 1))",
        ],
        "found reinit(v, ...), but v is the same state as w, which a when sets as well",
    ),
]


@pytest.mark.parametrize(("names", "lines", "words"), STATEMENTS)
def test_what_cannot_be_stated_of_instants(names, lines, words):
    assert words in refused(*lines, **{name: MEMBERS[name] for name in names})


def test_what_can_be_stated_in_their_place():
    joined = falling("when(self.h < 0, self.n == 1).elsewhen(self.v < 0, self.n == 2)", **COUNT)
    assert [one.after for one in flatten(joined).whens] == [-1, 0]
    text = refused("self.n == self.h", SET, kind=StructureError, **COUNT)
    assert "n, a Discrete, counts as known" in text
    with pytest.raises(ModelError, match=r"the modification bounces=3, an equation.*bounces=Start\(3\)"):
        translate(Ball(bounces=3), events=True)
    assert translate(Ball(bounces=Start(3)), events=True).start["bounces"] == 3
    alias = falling("self.y == -2 * self.v", "when(self.h < 0, reinit(self.y, 1))", y=Real(unit="m/s"))
    assert set(translate(alias, events=True).states) == {"h", "v"}
    with pytest.raises(ModelError, match="outside of equations"):
        pre(ca.SX.sym("x"))


class Lever(Model):
    """A point on a circle: one of its coordinates can be a state."""

    x = Real(start=0.6)
    y = Real(start=0.8)
    w = Real(start=0.0)
    v = Real()

    def equations(self):
        yield self.x**2 + self.y**2 == 1
        yield der(self.y) == self.w
        yield der(self.x) == self.v
        yield der(self.v) + der(self.w) == -1
        yield when(self.y < 0, reinit(self.y, 0.1), reinit(self.w, -0.5 * pre(self.w)))


def test_what_is_set_anew_becomes_a_state():
    assert set(translate(Lever(), events=True).states) == {"y", "w"}


def test_who_cannot_work_with_whens():
    with pytest.raises(ModelError, match=r"equation 3, when.*found a condition at which variables jump"):
        translate(Ball())
    with pytest.raises(ModelError, match="found a condition at which variables jump"):
        linearize(translate(Ball(), events=True))
    assert check(Ball()).conditions == ("the model (Ball), equation 3, when((h<=0)): reinit v, bounces",)
    assert "when((h<=0)): reinit v, bounces" in str(check(Ball()))


class Row(Model):
    """Balls that count together."""

    balls = Array(Ball, 2)
    all = Discrete(0, unit="1")
    fast = Discrete(False)

    def equations(self):
        for k in range(2):
            ball = self.balls[k]
            yield (
                when(logic_and(ball.h < 2, logic_not(between(-1, ball.v, 1))), terminate("fast"))
                if k
                else when(
                    ball.bounces > 3, self.all == pre(self.all) + ball.bounces, self.fast == (ball.v > 0)
                )
            )


def test_arrays_of_components():
    flat = flatten(Row())
    assert flat.discretes == ("all", "fast", "balls[0].bounces", "balls[1].bounces")
    assert [one.path for one in flat.whens] == ["", "", "balls[0]", "balls[1]"]
    assert [one.message for one in flat.whens] == ["", "fast", "", ""]
    assert {leaf.name() for leaf in ca.symvar(flat.whens[2].condition)} == {"balls[0].h"}


def test_mod_and_limit():
    x = ca.SX.sym("x")
    values = [-7.5, -3.0, -0.5, 0.0, 2.0, 3.0, 8.25]
    up, down, held = (ca.Function("f", [x], [e]) for e in (mod(x, 3), mod(x, -3), limit(x, -1, 2)))
    # Python's sign is that of the divisor, too
    assert [float(up(v)) for v in values] == [v % 3 for v in values]
    assert [float(down(v)) for v in values] == [v % -3 for v in values]
    assert [float(held(v)) for v in values] == [min(max(v, -1), 2) for v in values]
    assert limit(-5, -1, 2) == -1
    assert mod(-1, 3) == 2
    for function in (logic_and, logic_or):
        with pytest.raises(ModelError, match=f"{function.__name__}: found no condition"):
            function()


class Ramp(Model):
    """Formulas of a class body may switch, too."""

    a = Parameter(2.0)
    b = Parameter(limit(mod(a, 3.0), 0.0, 1.5))
    y = Real(start=0.0, fixed=True)

    def equations(self):
        yield der(self.y) == self.b + 0 * time


def test_formulas_of_declarations():
    assert simulate(Ramp(), stop=1.0, points=2).final("y") == pytest.approx(1.5, rel=1e-9)


def test_equations_are_written_with_their_whens():
    text = translate(Ball(), events=True).equations()
    assert "when h <= 0: v := -e*v, bounces := pre(bounces) + 1    # from the model" in text
    lines = ("when(self.n > 3, terminate('four')).elsewhen(self.h < 0, self.n == pre(self.n) + 1)",)
    for format in ("text", "latex", "html"):
        written = translate(falling(*lines, **COUNT), events=True).equations(format)
        assert "elsewhen" in written
        assert "terminate: four" in written
