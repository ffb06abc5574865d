"""What cannot be sampled, and who cannot work with what is."""

import math

import casadi
import numpy as np
import pytest

from gantrytau import (
    ModelError,
    Parameter,
    Real,
    SolveError,
    StructureError,
    der,
    extract_mechanism,
    sampled,
    simulate,
    sqrt,
    translate,
)
from gantrytau_optimica import Free, Optimization, final, optimize
from tests.simulation.sampled_models import Held, Slide


def stating(text: str, **members):
    """A slide whose equations end in one more statement, evaluated with its names at hand."""

    def equations(self):
        yield from Slide.equations(self)
        names = dict(self=self, sampled=sampled, der=der, sqrt=sqrt, math=math, casadi=casadi)
        for line in text.split("; "):
            yield eval(line, names)

    return type("Faulty", (Slide,), {"__doc__": "A slide.", **members, "equations": equations})()


HELD = dict(
    h=Real(unit="N", description="held"),
    r=Real(2, unit="N", description="held vector"),
    p=Parameter(0.1, unit="s", description="period"),
    c=Parameter(3.0, unit="N/m", description="stiffness"),
)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("sampled(self.f, self.c * self.x, period=0.1)", "found f, declared as input"),
        ("sampled(self.c, self.c, period=0.1)", "found c, declared as parameter"),
        ("sampled(der(self.x), self.v, period=0.1)", "found der(x), a derivative, expected"),
        ("sampled(2 * self.h, self.h, period=0.1)", "found '(2.*h)', expected a variable declared as Real"),
        ("sampled(3, self.h, period=0.1)", "found '3', expected a variable declared as Real"),
        ("sampled(self.r, self.h, period=0.1)", "the expression has shape (1, 1), expected (2, 1)"),
        ("sampled(self.h, self.r, period=0.1)", "the expression has shape (2, 1), expected (1, 1)"),
        ("sampled(self.h, 'push', period=0.1)", "found the expression 'push'"),
        ("sampled(self.h, self.h, period=0)", "found period=0, expected a finite number above zero, in s"),
        ("sampled(self.h, self.h, period=-1.0)", "found period=-1, expected a finite number above zero"),
        ("sampled(self.h, self.h, period=math.inf)", "found period=inf, expected a finite number above zero"),
        ("sampled(self.h, self.h, period=math.nan)", "found period=nan, expected a finite number above zero"),
        ("sampled(self.h, self.h, period=0 * self.p)", "found period=0, expected a finite number above zero"),
        ("sampled(self.h, self.h, period=-self.p)", "found p = 0.1; expected a sampling period above zero"),
        ("sampled(self.h, self.h, period=self.x)", "found x in period, expected a number or an expression"),
        ("sampled(self.h, self.h, period=self.r)", "period has shape (2, 1), expected (1, 1)"),
        ("sampled(self.h, self.h, period=self.c)", "sampled(h), its time: units disagree in `time == c`"),
        ("sampled(self.h, self.h, period=0.1, start=self.x)", "found x in start, expected a number or an"),
        ("sampled(self.h, self.x, period=0.1)", "sampled(h): units disagree in `h == x`"),
        ("sampled(self.h, self.c * self.x + self.v, period=0.1)", "sampled(h): units disagree: `(c*x)` is"),
        ("sampled(self.h, self.h * math.nan, period=0.1)", "found nan in"),
        ("sampled(self.h, 1, period=0.1); sampled(self.h, 2, period=0.1)", "found h, which the model"),
        ("sampled(self.r, 0 * self.r, period=0.1); sampled(self.r[1], 2, period=0.1)", "found r[1], which"),
        ("sampled(self.h, 1, period=0.1); self.r == 0; self.x == self.h / self.c", "h is sampled and jumps"),
        ("sampled(self.h, 1, period=0.1); self.r == 0; self.s == der(self.h)", "h is sampled and jumps at"),
        ("sampled(self.s, 1, period=0.1, start=2.0)", "found start= and the start value of the declaration"),
    ],
)
def test_what_cannot_be_sampled_is_refused_with_place_and_remedy(text, words):
    more = {"s": Real(description="held", start=1.0)} if "self.s" in text else {}
    count = 2 if "self.x == " in text else 1  # of what is known, less what the statements determine
    free = {"f": Real(unit="N", description="force")} if count == 2 else {}
    with pytest.raises(ModelError) as caught:
        translate(stating(text, **HELD, **more, **free), events=True)
    assert words in str(caught.value)


def test_continuous_uses_refuse_what_is_sampled():
    dae = translate(Held(), events=True)
    words = (
        r"control \(Pd\), sampled\(control.force\): found a value that jumps.* simulate, linearize and FMUs"
    )
    with pytest.raises(ModelError, match=words):
        translate(Held())
    with pytest.raises(ModelError, match=words):
        extract_mechanism(dae, tool="slide.x", joints=["slide.x"], forces=["slide.f"])
    with pytest.raises(ModelError, match=r"given: control.force is set at instants .* leave it out"):
        translate(Held(), given=["control.force"], events=True)
    with pytest.raises(ModelError, match=r"control.force is sampled and jumps at instants, but wanted der"):
        translate(Held(), find=["der(control.force)"], events=True)
    with pytest.raises(ModelError, match=r"control.force is not an input of Held .inputs: control.wanted"):
        simulate(dae, stop=1.0, inputs={"control.force": 1.0})


class Shortest(Optimization):
    """Bring the slide to rest."""

    plant = Held()
    final_time = Free(1.0, unit="s", min=0.1, max=5.0, description="duration")

    def objective(self):
        return self.final_time

    def constraints(self):
        yield final(self.plant.slide.x) == 0


def test_optimisation_refuses_what_is_sampled():
    with pytest.raises(ModelError, match=r"plant.control \(Pd\)"):
        optimize(Shortest)


class Falling(Slide):
    """A sampled root that ends."""

    h = Real(unit="1", description="held")
    one = Parameter(1.0, unit="m", description="one")

    def equations(self):
        yield from super().equations()
        yield sampled(self.h, sqrt(self.x / self.one), period=0.1)


def test_a_new_value_that_is_not_finite_stops_the_simulation_with_what_was_reached():
    with pytest.raises(SolveError, match=r"h is sampled at t = 1.1 s") as caught:
        simulate(Falling(v=dict(start=-1.0), x=dict(start=1.05)), stop=2.0, points=21)
    assert caught.value.time == pytest.approx(1.1)
    assert caught.value.result.final("h") == pytest.approx(np.sqrt(0.05), rel=1e-6)


def test_a_period_that_would_not_let_the_simulation_end_is_refused():
    with pytest.raises(ModelError, match=r"control.force is sampled every 1e-09 s"):
        simulate(Held(control=dict(period=1e-9)), stop=1.0)


def test_an_equation_for_a_sampled_variable_is_one_too_many():
    with pytest.raises(StructureError, match=r"Overdetermined by 1: .*h == 3"):
        translate(stating("sampled(self.h, 1, period=0.1); self.h == 3; self.r == 0", **HELD), events=True)
