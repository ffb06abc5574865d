"""Directional and adjoint derivatives of exported FMUs, against CasADi's exact Jacobian of the same equations."""

from collections.abc import Sequence
from ctypes import c_double, c_size_t
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from gantrytau import Input, Model, Output, Parameter, Real, cos, der, sin, time
from tests.fmu.exported import Exported, Numbers, Running, export
from tests.fmu.runtime.raw_calls import ERROR, OK, integers, reals
from tests.fmu.runtime.test_sticking import OnSpring

# Relative to the largest slope of the same unknown. Rounding of a solved pose alone moves slopes of the six-link robot,
# whose forces follow from some forty equations, by up to 6e-12 on each side of the comparison.
BOUNDS = {"six-link": 3e-11}
NAMES = ("three-link", "six-link", "four-bar", "pendulum", "filter", "sampled")


class Forced(Model):
    """Explicit in time, with an output of each kind: a state, a derivative, and a formula."""

    w = Parameter(3.0, unit="rad/s", description="angular frequency")
    u = Input(description="input", start=0.3)
    x = Real(start=0.4, fixed=True, description="state")
    y = Output(description="formula")

    def equations(self):
        yield der(self.x) == -(self.x**2) * self.u + sin(self.w * time)
        yield self.y == der(self.x) * self.u + cos(time * self.x)


class Settled(Model):
    """A state at rest before it starts, and an implicit unknown that it depends on."""

    b = Parameter(0.5, description="slope")
    u = Input(description="input", start=1.0)
    x = Real(description="state")
    z = Real(description="implicit unknown", start=1.0)
    y = Output(description="product")

    def equations(self):
        yield der(self.x) == self.u - self.x - self.x**3 - self.z
        yield cos(self.z) == self.b * self.z
        yield self.y == self.z * self.x

    def initial_equations(self):
        yield der(self.x) == 0


class Undetermined(Model):
    """At rest at x = 1; with b = 1 and u = 0 by a double root, which does not say how it moves with u."""

    b = Parameter(0.0, description="from a line to a parabola")
    u = Input(description="input", start=1.0)
    x = Real(description="state")

    def equations(self):
        yield der(self.x) == self.u - (1 - self.b) * self.x - self.b * (self.x - 1) ** 2

    def initial_equations(self):
        yield der(self.x) == 0


@pytest.fixture(params=[2, 3], ids=["fmi2", "fmi3"])
def version(request):
    return request.param


@pytest.fixture(params=NAMES)
def fmu(request, version, exported) -> Exported:
    return exported(request.param, version)


def seeded(run: Running, unknown: Sequence[int], known: Sequence[int], seed: Any) -> np.ndarray:
    """J seed."""
    found, n, m = reals([np.nan] * len(unknown)), c_size_t(len(unknown)), c_size_t(len(known))
    counts = ((), ()) if run.fmu.version == 2 else ((m,), (n,))
    references = (integers(unknown), n, integers(known), m)
    status = run.instance("GetDirectionalDerivative", *references, reals(seed), *counts[0], found, *counts[1])
    assert status == OK, run.instance.message
    return np.array(found)


def transposed(run: Running, unknown: Sequence[int], known: Sequence[int], seed: Any) -> np.ndarray:
    """The transpose of J times seed."""
    found, n, m = reals([np.nan] * len(known)), c_size_t(len(unknown)), c_size_t(len(known))
    references = (integers(unknown), n, integers(known), m)
    status = run.instance("GetAdjointDerivative", *references, reals(seed), n, found, m)
    assert status == OK, run.instance.message
    return np.array(found)


def columns(run: Running, unknown: Sequence[int], known: Sequence[int]) -> np.ndarray:
    """J, one column after another."""
    return np.array([seeded(run, unknown, [k], [1.0]) for k in known]).T


def some_outputs(fmu: Exported) -> list[str]:
    """Twenty outputs of all kinds, evenly picked, by the names that both the FMU and the model know."""
    found = [
        v.name
        for v in fmu.described.modelVariables
        if v.causality == "output" and v.variability == "continuous" and ",2)" not in v.name
    ]
    return found[:: max(1, len(found) // 20)]


def rates_of(fmu: Exported) -> tuple[list[int], list[int]]:
    """References of derivatives, and of their states."""
    rates = [unknown.variable for unknown in fmu.described.derivatives]
    return [v.valueReference for v in rates], [v.derivative.valueReference for v in rates]


def knowns_of(fmu: Exported) -> list[int]:
    """References of time, states, inputs and parameters, in the order of Numbers."""
    system = fmu.dae.system()
    names = [*system.inputs, *system.parameters]
    return [fmu.references["time"], *rates_of(fmu)[1], *(fmu.references[n] for n in names)]


def unknowns_of(fmu: Exported, outputs: Sequence[str]) -> list[int]:
    return [*rates_of(fmu)[0], *(fmu.references[n] for n in outputs)]


def at_random(
    run: Running, truth: Numbers, random: np.random.Generator
) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
    """Put the FMU to a random time, state, input and parameter near the start; return these."""
    fmu = run.fmu
    x = truth.x + 0.02 * random.standard_normal(truth.x.size)
    p = truth.p * random.uniform(0.999, 1.001, truth.p.size)
    free = [n in set(fmu.dae.inputs) for n in fmu.dae.system().inputs]
    u = np.where(free, random.uniform(-60, 60, truth.u.size), truth.u)
    t = random.uniform(0.0, 0.001)
    assert run.instance("SetTime", c_double(t)) == OK
    assert run.instance("SetContinuousStates", reals(x.tolist()), c_size_t(x.size)) == OK
    for name, value, own in zip(fmu.dae.system().inputs, u, free, strict=True):
        if own:
            run[name] = value
    for name, value in zip(fmu.dae.system().parameters, p, strict=True):
        if fmu.described.modelVariables[fmu.references[name]].variability == "tunable":
            run[name] = value
        else:
            p[list(fmu.dae.system().parameters).index(name)] = run[name]
    u = np.where(free, u, [run[n] for n in fmu.dae.system().inputs])
    return t, x, u, p


def test_every_slope_is_that_of_the_equations(fmu, request):
    """By time, states, inputs, what is held, and parameters; through the blocks that are solved inside."""
    name = next(n for n in NAMES if n in request.node.callspec.id)
    outputs = some_outputs(fmu)
    truth = Numbers(fmu.dae, outputs)
    unknown, known = unknowns_of(fmu, outputs), knowns_of(fmu)
    random = np.random.default_rng(7)
    with fmu.new("ModelExchange") as run:
        run.begin()
        run.settle()
        for _ in range(3):
            point = at_random(run, truth, random)
            wanted = truth.jacobian(*point)
            # unlike quantities stand in one Jacobian: each row has a size of its own
            sizes = np.abs(wanted).max(axis=1, keepdims=True)
            off = np.abs(columns(run, unknown, known) - wanted) / np.where(sizes > 0, sizes, 1.0)
            assert off.max() < BOUNDS.get(name, 1e-12)
            seed = random.standard_normal(len(known))
            sizes = np.abs(wanted) @ np.abs(seed)
            off = np.abs(seeded(run, unknown, known, seed) - wanted @ seed) / np.where(sizes > 0, sizes, 1.0)
            assert off.max() < BOUNDS.get(name, 1e-12)


@pytest.mark.parametrize("angle", [0.0, 1e-6])
def test_where_pivots_are_small_slopes_are_those_beside_it(exported, angle):
    """A crank in line with an axis, where the closed form divides by its sine: the library goes through its tape."""
    fmu = exported("four-bar", 3)
    outputs = some_outputs(fmu)
    unknown, known = unknowns_of(fmu, outputs), knowns_of(fmu)
    with fmu.new("ModelExchange") as run:
        run.begin()
        run.settle()
        at = [
            columns_at(run, unknown, known, phi)
            for phi in (angle, angle + 0.004, angle - 0.004, angle + 0.008, angle - 0.008)
        ]
    between = (4 * (at[1] + at[2]) - (at[3] + at[4])) / 6  # even terms of orders 0 and 2
    sizes = np.abs(between).max(axis=1, keepdims=True)
    off = np.abs(at[0] - between) / np.where(sizes > 0, sizes, 1.0)
    assert off.max() < 1e-6  # terms of order 4: 6e-8 measured


def columns_at(run: Running, unknown: Sequence[int], known: Sequence[int], phi: float) -> np.ndarray:
    """J of the four-bar at an angle of its crank, at rest."""
    x = [phi if name == "crank.phi" else 0.0 for name in run.fmu.dae.states]
    assert run.instance("SetContinuousStates", reals(x), c_size_t(len(x))) == OK
    return columns(run, unknown, known)


@pytest.mark.parametrize("name", NAMES)
def test_adjoints_are_the_transpose(name, exported):
    fmu = exported(name)
    unknown, known = unknowns_of(fmu, some_outputs(fmu)), knowns_of(fmu)
    random = np.random.default_rng(8)
    with fmu.new("ModelExchange") as run:
        run.begin()
        run.settle()
        whole = columns(run, unknown, known)
        for k, reference in enumerate(unknown[:5]):
            assert np.array_equal(transposed(run, [reference], known, [1.0]), whole[k])
        seed = random.standard_normal(len(unknown))
        sizes = np.abs(whole.T) @ np.abs(seed)
        assert (np.abs(transposed(run, unknown, known, seed) - whole.T @ seed) <= 1e-14 * sizes).all()


def test_time_states_derivatives_and_constants_are_unknowns_too(tmp_path, version):
    fmu = export(Forced(), tmp_path / "forced.fmu", version)
    u, x, w, t = 0.7, 0.6, 3.0, 0.2
    rate = -(x**2) * u + np.sin(w * t)
    by_t, by_x, by_u, by_w = w * np.cos(w * t), -2 * x * u, -(x**2), t * np.cos(w * t)
    rows = {
        "x": [0.0, 1.0, 0.0, 0.0],
        "der(x)": [by_t, by_x, by_u, by_w],
        "y": [by_t * u - x * np.sin(t * x), by_x * u - t * np.sin(t * x), by_u * u + rate, by_w * u],
    }
    with fmu.new("ModelExchange") as run:
        run.begin(u=u)
        run.settle()
        assert run.instance("SetTime", c_double(t)) == OK
        assert run.instance("SetContinuousStates", reals([x]), c_size_t(1)) == OK
        found = columns(run, [fmu.references[n] for n in rows], [fmu.references[n] for n in "xuw"])
        assert found == pytest.approx(np.array(list(rows.values()))[:, 1:], rel=1e-14, abs=1e-15)
        by_time = seeded(run, [fmu.references[n] for n in rows], [fmu.references["time"]], [1.0])
        assert by_time == pytest.approx([row[0] for row in rows.values()], rel=1e-14)


def test_after_steps_of_co_simulation_slopes_belong_to_the_states_shown(exported, version):
    fmu = exported("four-bar", version)
    outputs = some_outputs(fmu)
    truth = Numbers(fmu.dae, outputs)
    unknown, known = unknowns_of(fmu, outputs), knowns_of(fmu)
    with fmu.new() as run:
        run.begin(torque=3.0)
        for k in range(40):
            run.time = 0.004 * k
            run.step(0.004)
        truth.z = run[[a.name for a in fmu.dae.system().algebraics]]
        wanted = truth.jacobian(run.time, run[list(fmu.dae.states)], [3.0])
        run["torque"] = 0.5  # what is not linear in it would show, and that it was taken
        assert not np.array_equal(seeded(run, unknown, known, np.ones(len(known))), wanted.sum(axis=1))
        run["torque"] = 3.0
        sizes = np.abs(wanted).max(axis=1, keepdims=True)
        off = np.abs(columns(run, unknown, known) - wanted) / np.where(sizes > 0, sizes, 1.0)
        assert off.max() < 1e-12


def test_what_sticks_and_what_slides_have_slopes_of_their_own(tmp_path, version):
    """A mass on a spring: sliding, friction is constant; sticking, it takes all that the spring pulls."""
    fmu = export(OnSpring(), tmp_path / "spring.fmu", version)
    unknown = [fmu.references[n] for n in ("der(mass.v)", "floor.f")]
    known = [fmu.references[n] for n in ("mass.s", "mass.v", "spring.c", "floor.f_c", "floor.f_v")]
    with fmu.new("ModelExchange") as run:
        run.begin()
        run.settle()
        run.instance("SetContinuousStates", reals([0.05, -0.3]), c_size_t(2))  # slides back, see OnSpring
        assert columns(run, unknown, known) == pytest.approx(
            np.array([[-400.0, 0.0, -0.025, 0.5, 0.15], [0.0, 0.0, 0.0, -1.0, -0.3]])
        )
    with fmu.new("ModelExchange") as run:
        run.begin(**{"mass.s": 0.003})
        run.settle()
        run.instance("SetContinuousStates", reals([0.003, 0.0]), c_size_t(2))
        found = columns(run, unknown, known)
        assert found[0, [0, 2, 3, 4]] == pytest.approx(np.zeros(4), abs=1e-12)  # it stays
        assert found[1, [0, 2, 3, 4]] == pytest.approx([-800.0, -0.003, 0.0, 0.0])


def test_before_initialisation_ends_states_follow_their_equations(exported, version):
    """A filter at rest on its input: its output follows the input, and nothing moves whatever the input."""
    fmu = exported("filter", version)
    rates, states = rates_of(fmu)
    wanted = np.zeros((6, 2))
    wanted[0, 0] = 1.0
    with fmu.new() as run:
        run.enter()
        known = [fmu.references[n] for n in ("u", "bandwidth")]
        # the bandwidth is 19.6 rad/s, of which terms of the third derivative have the third power
        assert columns(run, [*states, *rates], known) == pytest.approx(wanted, abs=1e-12 * 19.6**3)
        if version == 3:
            seed = np.arange(1.0, 7.0)
            assert transposed(run, [*states, *rates], known, seed) == pytest.approx([1.0, 0.0], abs=1e-7)
        n, one, found = c_size_t(1), reals([1.0]), reals([0.0])
        counts = () if version == 2 else (n,)
        references = (integers(rates[:1]), n, integers(states[:1]), n)
        status = run.instance("GetDirectionalDerivative", *references, one, *counts, found, *counts)
        assert status == ERROR
        assert "y is no known before initialisation ends" in run.instance.message
        run.exit()
        assert seeded(run, rates, states[1:2], [1.0])[0] == 1.0


def test_initial_equations_that_are_not_linear_and_hold_for_implicit_unknowns(tmp_path, version):
    """x + x^3 + z = u at rest, where z is implicit: the slopes of both follow by differentiating twice."""
    fmu = export(Settled(), tmp_path / "settled.fmu", version)
    u, b = 2.0, 0.7
    z: Any = brentq(lambda z: np.cos(z) - b * z, 0.0, 1.5, xtol=1e-15)
    z_b = -z / (np.sin(z) + b)
    x: Any = brentq(lambda x: x + x**3 + z - u, -5.0, 5.0, xtol=1e-15)
    unknown = [fmu.references[n] for n in ("x", "der(x)", "z", "y")]
    known = [fmu.references[n] for n in ("u", "b")]
    x_u, x_b = 1 / (1 + 3 * x**2), -z_b / (1 + 3 * x**2)
    wanted = [[x_u, x_b], [0.0, 0.0], [0.0, z_b], [z * x_u, z * x_b + x * z_b]]
    with fmu.new() as run:
        run.enter()
        run["u"], run["b"] = u, b
        assert run[["x", "z"]] == pytest.approx([x, z], rel=1e-12)
        assert columns(run, unknown, known) == pytest.approx(np.array(wanted), rel=1e-12, abs=1e-14)


def test_initial_equations_that_do_not_say_how_a_state_moves_are_an_error(tmp_path):
    fmu = export(Undetermined(), tmp_path / "undetermined.fmu")
    x, u = ([fmu.references[n]] for n in "xu")
    with fmu.new() as run:
        run.enter()
        assert columns(run, x, u) == pytest.approx(1.0, rel=1e-14)
        run["b"], run["u"] = 1.0, 0.0
        assert run["x"] == 1.0
        n, found = c_size_t(1), reals([0.0])
        arguments = (integers(x), n, integers(u), n, reals([1.0]), n, found, n)
        for name in ("GetDirectionalDerivative", "GetAdjointDerivative"):
            assert run.instance(name, *arguments) == ERROR
            assert "the initial equations do not determine x at time = 0 s" in run.instance.message
