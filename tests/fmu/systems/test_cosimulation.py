"""Co-simulation: coupled masses against their analytic solution, orders of convergence, and failures on the way."""

import tempfile
from pathlib import Path

import numpy as np
import pytest

from gantrytau import InitializationError, ModelError, SolveError
from gantrytau_fmu import Master, cosimulate
from gantrytau_fmu.systems.connected_system import build_system
from gantrytau_fmu.systems.cosimulate import _read, _structure
from gantrytau_fmu.systems.step_order import sequence_of
from tests.fmu.systems.coupled_masses import WIRES, C, K, exact, first, second
from tests.fmu.systems.small_fmus import variable

pytestmark = pytest.mark.usefixtures("nothing_stays_behind")


def gain(build, name="g", code="v[2] = v[0] * v[1];", start=2.0, **more):
    lines = [variable("u", "input", 0.0), variable("k", "parameter", start), variable("y", "output")]
    return build(name, lines, derive=code, direct=("y",), **more)


def error(files, step, **policy):
    found = cosimulate(files, WIRES, stop=1.0, step=step, master=Master(**policy))
    return np.max(abs(found["a.x"] - exact(found.time)[0]))


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize(("order", "power"), [("gauss-seidel", 1), ("jacobi", 1), ("iterate", 2)])
def test_coupled_masses_converge_to_the_analytic_solution_with_the_order_of_the_coupling(
    build, fmi, order, power
):
    files = {"a": first(build, fmi), "b": second(build, fmi)}
    errors = [error(files, step, order=order) for step in (4e-3, 2e-3, 1e-3)]
    assert errors[-1] < 2e-3
    assert np.diff(np.log2(errors)) == pytest.approx(-power, abs=0.1)


def test_gauss_seidel_is_better_than_jacobi(halves):
    assert error(halves, 1e-3) < error(halves, 1e-3, order="jacobi") / 2  # measured: 2.6


def test_iteration_ends_where_inputs_and_outputs_agree_whatever_the_order_of_the_components(halves):
    runs = [
        cosimulate(
            halves,
            WIRES,
            stop=0.5,
            step=4e-3,
            master=Master(order="iterate", agreement=1e-12, sequence=sequence),
        )
        for sequence in (["a", "b"], ["b", "a"])
    ]
    assert np.max(abs(runs[0]["a.x"] - runs[1]["a.x"])) < 1e-11  # agreement, over 125 steps


def test_smaller_steps_keep_the_energy_better(halves):
    drifts = []
    for step in (2e-3, 1e-3):
        r = cosimulate(halves, WIRES, stop=1.0, step=step)
        energy = 0.5 * (r["a.v"] ** 2 + r["b.v"] ** 2 + K * r["a.x"] ** 2 + K * r["b.x"] ** 2)
        energy += 0.5 * C * (r["a.x"] - r["b.x"]) ** 2
        drifts.append(np.max(abs(energy - energy[0])) / energy[0])
    assert drifts[1] < 0.05
    assert drifts[0] / drifts[1] == pytest.approx(2.0, rel=0.15)


def test_inputs_show_what_drives_them_and_names_have_units(halves):
    found = cosimulate(halves, WIRES, stop=0.1, step=0.01)
    assert set(found.names) == {"a.x", "a.v", "b.x", "b.v", "b.f", "b.u", "a.f"}
    assert np.array_equal(found["b.u"], found["a.x"])
    assert found["b.f"][0] == pytest.approx(-C * 0.1, rel=1e-12)  # consistent from the beginning
    assert (found.unit("a.x"), found.unit("b.f")) == ("m", "N")
    assert found.time == pytest.approx(np.arange(11) * 0.01, abs=1e-15)
    few = cosimulate(halves, WIRES, stop=0.1, step=0.01, outputs=["b.x", "a.k"])
    assert few.names == ("b.x", "a.k")
    assert few["a.k"][0] == K


def test_components_take_steps_of_their_own(halves):
    errors = []
    for step in (2e-3, 1e-3):
        found = cosimulate(
            halves, WIRES, stop=1.0, step=step, master=Master(steps={"a": 4 * step, "b": step / 2})
        )
        errors.append(np.max(abs(found["a.x"][::4] - exact(found.time)[0][::4])))
    assert errors[1] < 5e-3
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.2)  # first order
    fine = cosimulate(halves, WIRES, stop=1.0, step=4e-3, master=Master(steps={"a": 1e-3, "b": 2e-3}))
    same = cosimulate(halves, WIRES, stop=1.0, step=4e-3)  # inputs are held, and both are exact then
    assert np.max(abs(fine["a.x"] - same["a.x"])) < 1e-12


def test_a_slow_jacobi_component_is_seen_when_its_interval_ends(halves):
    found = cosimulate(halves, WIRES, stop=0.04, step=1e-3, master=Master(order="jacobi", steps={"a": 4e-3}))
    assert np.all(found["a.x"][:4] == 0.1)
    assert found["a.x"][4] != 0.1


@pytest.mark.parametrize("order", ["gauss-seidel", "jacobi"])
def test_the_estimated_error_is_the_error(halves, order):
    found = cosimulate(halves, WIRES, stop=1.0, step=1e-3, master=Master(order=order, error_estimate=True))
    true = abs(found["a.x"] - exact(found.time)[0])
    assert np.max(found["error(a.x)"]) == pytest.approx(
        np.max(true), rel=0.05
    )  # first order, next term left out
    assert found.unit("error(a.x)") == "m"


def test_inputs_from_outside_are_numbers_functions_and_samples(build):
    files = {"a": first(build, name="alone")}
    held = cosimulate(files, stop=1.0, step=0.01, inputs={"a.f": 3.0})
    x0 = 3.0 / K
    assert held["a.x"] == pytest.approx(x0 + (0.1 - x0) * np.cos(10 * held.time), abs=1e-12)
    times = np.linspace(0, 1, 11)
    by_samples = cosimulate(files, stop=1.0, step=0.01, inputs={"a.f": (times, 2 * times)})
    by_function = cosimulate(files, stop=1.0, step=0.01, inputs={"a.f": lambda t: 2 * t})
    assert np.max(abs(by_samples["a.x"] - by_function["a.x"])) < 1e-14
    assert by_function["a.f"] == pytest.approx(2 * by_function.time)
    started = cosimulate(files, stop=1.0, step=0.01, start={"a.f": 3.0})
    assert np.array_equal(started["a.x"], held["a.x"])
    assert np.all(started["a.f"] == 3.0)


def test_start_values_reach_parameters(build):
    found = cosimulate({"a": first(build, name="set")}, stop=1.0, step=0.1, start={"a.k": 25.0})
    assert found["a.x"] == pytest.approx(0.1 * np.cos(5 * found.time), abs=1e-12)


def test_the_last_step_is_shorter_if_components_can(build):
    found = cosimulate({"a": first(build, name="odd")}, stop=0.95, step=0.1)
    assert found.time[-2:] == pytest.approx([0.9, 0.95], abs=1e-15)
    assert found.final("a.x") == pytest.approx(0.1 * np.cos(9.5), abs=1e-12)
    with pytest.raises(ModelError, match=r"a: .* takes only equal steps, and 0.1 s does not divide .*choose"):
        cosimulate({"a": first(build, name="even", even=True)}, stop=0.95, step=0.1)


def test_an_algebraic_loop_is_solved(build):
    files = {"g": gain(build), "h": gain(build, "h", "v[2] = 1 - v[1] * v[0];", 3.0)}
    found = cosimulate(
        files, [("g.y", "h.u"), ("h.y", "g.u")], stop=0.1, step=0.1, master=Master(order="jacobi")
    )
    assert found["g.u"][0] == pytest.approx(
        1 / 7, abs=1e-9
    )  # u = 1 - 3 (2 u), though carrying round diverges
    curved = {"g": gain(build, "curved", "v[2] = v[1] * exp(-v[0]);", 5.0)}
    found = cosimulate(curved, [("g.y", "g.u")], stop=0.1, step=0.1, master=Master(order="jacobi"))
    assert found["g.u"][0] * np.exp(found["g.u"][0]) == pytest.approx(5.0, abs=1e-8)


def test_an_algebraic_loop_without_a_solution_names_its_inputs(build):
    file = gain(build, "none", "v[2] = v[0] + v[1] + v[0] * v[0];", 1.0)
    with pytest.raises(InitializationError, match=r"algebraic loop without a solution.*g\.u") as caught:
        cosimulate({"g": file}, [("g.y", "g.u")], stop=1.0, step=0.1)
    assert set(caught.value.residuals) == {"g.u"}


def test_iteration_that_does_not_agree_says_where(halves):
    with pytest.raises(SolveError, match=r"after 2 iterations at t = 0 s .*[ab]\.[uf] was .*, is") as caught:
        cosimulate(
            halves, WIRES, stop=1.0, step=0.1, master=Master(order="iterate", iterations=2, agreement=1e-12)
        )
    assert caught.value.time == 0.0


def test_iteration_needs_saved_states(build, halves):
    files = {**halves, "a": first(build, name="forgetful", can_save=False)}
    with pytest.raises(ModelError, match=r"a: .*forgetful2.fmu cannot save .* order='iterate' needs; take"):
        cosimulate(files, WIRES, stop=1.0, step=0.1, master=Master(order="iterate"))
    with pytest.raises(ModelError, match=r"steps: a would step less often .*order='iterate'"):
        cosimulate(halves, WIRES, stop=1.0, step=0.1, master=Master(order="iterate", steps={"a": 0.2}))


def test_units_are_converted_or_refused(build, halves):
    millimetres = {**halves, "b": second(build, name="mm", unit="mm", advance="", derive="v[1] = v[0];")}
    found = cosimulate(millimetres, [("a.x", "b.u")], stop=0.1, step=0.1, start={"a.f": 0.0})
    assert found["b.u"] == pytest.approx(1000 * found["a.x"])
    with pytest.raises(ModelError, match=r"connection a\.v -> b\.u: found the units 'm/s' and 'm', expected"):
        cosimulate(halves, [("a.v", "b.u")], stop=1.0, step=0.1)


def test_vectors_connect_element_by_element(build):
    three = [variable(f"r[{k}]", "input", 0.0) for k in range(3)]
    three += [variable(f"s[{k}]", "output", float(k)) for k in range(3)]
    copy = "for (int k = 0; k < 3; k++) v[3 + k] = 2 * v[k];"
    source = build("source", three, fmi="3.0")
    files = {"a": source, "b": build("twice", three, derive=copy, fmi="3.0", direct=("s[0]", "s[1]", "s[2]"))}
    found = cosimulate(files, [("a.s", "b.r")], stop=0.2, step=0.1, inputs={"a.r": [0, 0, 0]})
    assert found["b.r"] == pytest.approx(np.tile([0.0, 1.0, 2.0], (3, 1)))
    assert found.final("b.s") == pytest.approx([0.0, 2.0, 4.0])
    with pytest.raises(ModelError, match=r"a\.s -> b\.r\[0\]: found 3 and 1 elements, expected equally many"):
        cosimulate(files, [("a.s", "b.r[0]")], stop=0.2, step=0.1)


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_a_failing_step_says_when_and_what_the_log_said_and_keeps_what_there_is(build, fmi):
    files = {
        "a": first(build, fmi, name="breaks", advance="if (t > 0.45) return 3; v[1] = t + h;"),
        "b": second(build),
    }
    with pytest.raises(SolveError, match=r"a: step: status 'error' at t = 0\.5 s; its log says") as caught:
        cosimulate(files, WIRES, stop=1.0, step=0.1)
    assert caught.value.time == pytest.approx(0.5)
    assert caught.value.result["a.x"][1:] == pytest.approx([0.1, 0.2, 0.3, 0.4, 0.5])


def test_values_that_are_not_finite_are_named(build):
    files = {
        "a": first(build, name="grows", advance="v[1] = t > 0.25 ? NAN : 1; v[2] = 1;"),
        "b": second(build),
    }
    with pytest.raises(SolveError, match=r"a: found a\.x = nan at t = 0\.4 s, expected finite") as caught:
        cosimulate(files, WIRES, stop=1.0, step=0.1)
    assert caught.value.time == pytest.approx(0.4)
    assert caught.value.result.time[-1] == pytest.approx(0.3)


def test_an_interrupted_simulation_keeps_what_there_is(halves):
    def press(t):
        if t > 0.35:
            raise KeyboardInterrupt

    with pytest.raises(SolveError, match=r"co-simulation interrupted at t = 0\.4 s; \.result") as caught:
        cosimulate(halves, WIRES, stop=1.0, step=0.1, master=Master(progress=press))
    assert caught.value.result.time[-1] == pytest.approx(0.4)
    assert isinstance(caught.value.__context__, KeyboardInterrupt)


def test_sampled_components_step_first_and_those_with_feedthrough_last(build):
    held = [
        variable("u", "input", 0.0),
        variable("y", "output"),
        variable("seen", "local", 0.0, variability="discrete"),
    ]
    files = {
        "filter": gain(build, "filter"),
        "force": gain(build, "force"),
        "plant": first(build, name="plant"),
        "controller": build("controller", held, direct=("y",)),
        "reference": build("reference", [variable("y", "output", 1.0)]),
    }
    wires = [
        ("plant.x", "filter.u"),
        ("filter.y", "controller.u"),
        ("controller.y", "force.u"),
        ("force.y", "plant.f"),
    ]
    with tempfile.TemporaryDirectory() as folder:
        parts = _read(_structure(files, wires, Path(folder)).components, Path(folder), Master())
        system = build_system(parts, wires, {}, {}, (0.0, 1.0))
    assert sequence_of(system) == ("controller", "plant", "reference", "filter", "force")
    assert sequence_of(system, list(files)) == tuple(files)
