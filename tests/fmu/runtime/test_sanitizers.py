"""All calls of both versions, right and wrong, under gcc's sanitizers, under valgrind, and past strict warnings."""

import re
import shutil

import pytest

from tests.families import first_of
from tests.fmu.runtime.robust_models import SANITIZERS, compiler, driver, has_sanitizers, run, unpacked

MODELS = (
    "parallelogram",
    "sledge",
    "juggled",
    "stiffly_late",
    "stiffly_juggled",
    "late",
    "thrown",
)  # implicit blocks; friction and samples; whens; delays; jumps of states


@pytest.mark.parametrize("model", first_of(MODELS, 4))
def test_addresses_undefined_behaviour_and_leaks(model):
    if not has_sanitizers():
        pytest.skip("gcc has no sanitizers")
    done = run([driver(model, "all_calls", *SANITIZERS)])
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("model", first_of(MODELS, 4))
def test_valgrind_finds_nothing(model):
    """Uninitialised values too, which the sanitizers do not see."""
    if shutil.which("valgrind") is None:
        pytest.skip("no valgrind")
    check = ["valgrind", "--quiet", "--leak-check=full", "--show-leak-kinds=all", "--error-exitcode=9"]
    done = run([*check, driver(model, "all_calls")])
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("model", MODELS)
def test_the_sources_are_strict(model):
    """ISO C 99 without warnings but those of functions that one model or another does not need."""
    unit = unpacked(model).sources / "fmu.c"
    wanted = [
        "-std=c99",
        "-O0",
        "-Wall",
        "-Wextra",
        "-Wpedantic",
        "-Wno-unused-function",
        "-Wvla",
        "-Wstrict-prototypes",
    ]
    done = run([compiler(), *wanted, "-fsyntax-only", unit])
    assert re.findall("warning: .*|error: .*", done.stderr) == []
