"""The C of an `Mpc` gives the inputs of its Python, sample by sample, and asks for nothing but mathematics."""

import ctypes
import re
import shutil
import subprocess
from typing import Any

import numpy as np
import pytest

from gantrytau import Input, Model, ModelError, Real, der, sin, time
from gantrytau_optimica import Mpc, Optimization, final
from tests.optimica.predictive.recorded import recorded_run
from tests.optimica.predictive.test_mpc import Upright

pytestmark = pytest.mark.skipif(not shutil.which("cc"), reason="needs a C compiler")
NOISE = {"pole.p": 0.01, "pole.th": 0.01}


class Controller:
    """The C of an Mpc, compiled with warnings as errors."""

    def __init__(self, code, folder):
        header, source = code.write(folder)
        library = folder / "controller.so"
        flags = ["-std=c99", "-O2", "-Wall", "-Werror", "-ffp-contract=off", "-shared", "-fPIC"]
        subprocess.run(["cc", *flags, "-o", library, source, "-lm"], check=True)
        size = folder / "size"
        told = f'#include <stdio.h>\n#include "{header}"\nint main(void) {{ printf("%zu", sizeof(controller_state)); }}'
        (folder / "size.c").write_text(told)
        subprocess.run(["cc", "-o", size, folder / "size.c"], check=True)
        self._size = int(subprocess.run([size], check=True, capture_output=True, text=True).stdout)
        self._step = ctypes.CDLL(str(library)).controller_step
        self._step.argtypes = [ctypes.c_void_p] * 3
        self._found = np.zeros(len(code.find))

    def run(self, states):
        """Inputs for measured states (n, x), from the first step on."""
        memory, inputs = np.zeros(self._size // 8 + 1), []
        for state in np.array(states):
            self._step(memory.ctypes.data, state.ctypes.data, self._found.ctypes.data)
            inputs.append(self._found.copy())
        return np.array(inputs)


class Ends(Upright):
    """Costs at the end, and what is not convex between."""

    def integrand(self):
        return 0.1 * self.pole.f**2 + 0.1 * self.pole.p * self.pole.f

    def objective(self):
        pole = self.pole
        return 100 * final(pole.th) ** 2 + 30 * final(pole.p) ** 2 + final(pole.v) ** 2


class Valve(Model):
    """A tank whose flow follows from an equation without a closed form."""

    level = Real(start=1.0)
    flow = Real()
    opening = Input(min=0.0, max=1.0)

    def equations(self):
        yield der(self.level) == self.opening - self.flow
        yield self.flow + 0.5 * self.flow**3 + 0.1 * sin(self.flow) == self.level


class Filled(Optimization):
    """The level shall be 0.6, the flow below 0.7."""

    valve = Valve()

    def integrand(self):
        return (self.valve.level - 0.6) ** 2 + 0.1 * (self.valve.opening - 0.5) ** 2

    def constraints(self):
        yield self.valve.flow <= 0.7


class Emptied(Optimization):
    """As little as may be, with a cost without curvature."""

    valve = Valve()

    def integrand(self):
        return 1e-3 * self.valve.level

    def constraints(self):
        yield self.valve.flow >= 0.4


@pytest.mark.parametrize(
    ("problem", "keywords", "run"),
    [
        (Upright, dict(period=0.05, elements=40), dict(noise=NOISE, seed=4)),
        (Upright, dict(period=0.05, elements=20, terminal="lqr", delay=1), {}),
        (
            Upright,
            dict(
                period=0.05,
                elements=15,
                rates={"pole.f": (-200.0, 100.0)},
                step_penalty={"pole.f": 0.002},
                blocks=[1, 1, 2, 4],
                hard="all",
                iterations=2,
            ),
            {},
        ),
        (Ends, dict(period=0.05, elements=20), {}),
        (Filled, dict(period=0.1, elements=8, terminal="lqr"), {}),
        (Emptied, dict(period=0.1, elements=8), {}),
    ],
    ids=["noise", "delay", "moves", "end", "implicit", "linear"],
)
def test_the_c_gives_the_inputs_of_python(problem, keywords, run, tmp_path):
    mpc = Mpc(problem, **keywords)
    states, inputs = recorded_run(mpc, stop=1.0, **run)
    found = Controller(mpc.c_code(), tmp_path).run(states)
    np.testing.assert_allclose(found, inputs, rtol=0, atol=1e-9 * mpc.stages.sizes_u.max())


def given_by(mpc, states):
    """Inputs (n, u) of an Mpc's Python for measured states (n, x)."""
    mpc.reset()
    named = [dict(zip(mpc.states, one, strict=True)) for one in states]
    return [list(mpc.step(one, mpc.period * k).values()) for k, one in enumerate(named)]


def test_what_is_measured_as_nothing_is_foretold_in_c_too(tmp_path):
    mpc = Mpc(Upright, period=0.05, elements=10, delay=1)
    states = np.array(
        [[0.3, 0.2, 0.0, 0.0], [np.nan, 0.15, np.inf, 0.1], [1e9, 0.1, 0.0, 0.0], [0.2, 0.1, 0.0, 0.0]]
    )
    controller = Controller(mpc.c_code(), tmp_path)
    np.testing.assert_allclose(controller.run(states), given_by(mpc, states), atol=2e-8)
    # before there is a plan, an input within its limits
    first = controller.run([[np.nan] * 4, *states])
    np.testing.assert_allclose(first, [[0.0], *given_by(mpc, states)], atol=2e-8)


@pytest.mark.parametrize("delay", [0, 1])
def test_a_plan_that_a_wrong_measurement_has_spoilt_is_made_anew_in_c(tmp_path, delay):
    mpc = Mpc(Upright, period=0.05, elements=10, delay=delay)
    code = Controller(mpc.c_code(), tmp_path)
    for wild in (1e3, 1e9, -1e300):
        states = np.array([[0.3, 0.2, 0.0, 0.0]] * 5)
        states[2, 3] = wild
        np.testing.assert_allclose(code.run(states)[4], given_by(mpc, states)[4], rtol=0.01)


def test_estimates_are_given_behind_the_state_in_c(tmp_path):
    mpc = Mpc(Upright, period=0.05, elements=10, disturbance=["pole.f"], parameters=["pole.length"])
    code = mpc.c_code()
    assert code.given == (*mpc.states, *mpc.estimated)
    assert (code.starts["pole.length"], code.starts["pole.p"]) == (0.5, 0.3)
    rows = np.array(
        [[0.3, 0.2, 0.0, 0.0, 0.5, 0.0], [0.25, 0.15, 0.0, 0.0, 0.6, 2.0], [0.2, 0.1, 0.0, 0.0, np.nan, 3.0]]
    )
    inputs = [
        list(mpc.step(dict(zip(code.given, row, strict=True)), 0.05 * k).values())
        for k, row in enumerate(rows)
    ]
    np.testing.assert_allclose(Controller(code, tmp_path).run(rows), inputs, atol=2e-8)


def test_an_mpc_in_machine_code_gives_what_it_gave_before(tmp_path, monkeypatch):
    monkeypatch.setenv("GANTRYTAU_CACHE", str(tmp_path))  # 3 s to compile
    keywords: Any = dict(
        rates={"pole.f": (-200.0, 100.0)}, blocks=[1, 1, 2, 4], disturbance=["pole.f"], terminal="lqr"
    )
    mpc = Mpc(Upright, period=0.05, elements=15, **keywords)
    beyond = {"pole.p": 2.2, "pole.th": 0.0, "pole.v": 0.0, "pole.w": 0.0, "disturbance(pole.f)": 0.5}

    def found():
        loop = mpc.run(stop=1.0, noise=NOISE, seed=4)
        mpc.reset()
        return [*loop["pole.f"], mpc.step(beyond)["pole.f"], *mpc.plan["pole.p"]], loop.statuses, mpc.softened

    numbers, *words = found()
    assert mpc.compiled()
    again, *said = found()
    np.testing.assert_allclose(again, numbers, atol=1e-7)
    assert words == said
    assert mpc.softened


def test_a_model_that_is_no_c_is_called_from_python(tmp_path, monkeypatch):
    monkeypatch.setenv("GANTRYTAU_CACHE", str(tmp_path))

    class Sampled(Upright):
        def integrand(self):
            return (self.pole.p - sin(time)) ** 2 + self.pole.th**2 + 0.01 * self.pole.f**2

    mpc = Mpc(Sampled, period=0.05, elements=5, terminal="lqr")
    assert mpc.compiled()
    assert mpc._newton.code is None
    assert mpc.run(stop=0.2).statuses == ("solved",) * 4


@pytest.mark.skipif(not shutil.which("nm"), reason="needs nm")
def test_the_c_has_no_heap_and_no_memory_of_its_own(tmp_path):
    _, source = Mpc(Upright, period=0.05, elements=5).c_code().write(tmp_path)
    subprocess.run(["cc", "-std=c99", "-c", "-o", tmp_path / "c.o", source], check=True)
    names = subprocess.run(["nm", tmp_path / "c.o"], check=True, capture_output=True, text=True).stdout
    asked = set(re.findall(r"^ +U (\w+)", names, re.MULTILINE))
    assert asked <= {
        "sqrt",
        "fabs",
        "fmin",
        "fmax",
        "sin",
        "cos",
        "memcpy",
        "memmove",
        "memset",
        "__stack_chk_fail",
    }
    assert not re.findall(r"^\w+ [bBdDC] \w+", names, re.MULTILINE)


def test_a_state_of_rest_that_moves_is_no_c():
    class Following(Upright):
        def integrand(self):
            return (self.pole.p - sin(time)) ** 2 + self.pole.th**2 + 0.01 * self.pole.f**2

    with pytest.raises(ModelError, match="a state of rest that moves with time"):
        Mpc(Following, period=0.05, elements=5, terminal="lqr").c_code()
