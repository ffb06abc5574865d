"""Random calls, right and wrong, of both versions under sanitizers; see c/fuzz.c for what must hold after each.

A few seconds with fixed seeds; GANTRYTAU_FUZZ_SECONDS=60 goes on with new seeds, and with all models, for a minute.
"""

import itertools
import os
import time

import pytest

from tests.fmu.runtime.robust_models import MAKERS, SANITIZERS, compiler, driver, has_sanitizers, run

SECONDS = float(os.environ.get("GANTRYTAU_FUZZ_SECONDS", "0"))
FEW = ("pendulum", "sledge", "juggled", "parallelogram", "root", "lags")
CALLS = 15_000 if SECONDS else 2_000


def program(model):
    compiler()  # or skip
    # optimising for the sanitizers takes longer than all calls of a quick run
    optimised = ("-O1",) if SECONDS else ()
    # absurd parameters bring a step to its limit of 20 thousand: too long for quick runs, and with sanitizers for the
    # largest model
    steps = () if SECONDS and model != "six_link" else ("-DGT_MOST_STEPS=1000",)
    options = (*optimised, *steps)
    return driver(model, "fuzz", *options, *(SANITIZERS if has_sanitizers() else ()))


def fuzz(model, seed):
    """The code with which random calls end, and what the sanitizers and the driver complain of."""
    done = run([program(model), str(seed), str(CALLS)])
    return done.returncode, done.stderr


@pytest.mark.parametrize("model", FEW)
@pytest.mark.skipif(SECONDS > 0, reason="the long run does more")
def test_random_calls(model):
    assert fuzz(model, 1) == (0, "")


@pytest.mark.skipif(not SECONDS, reason="GANTRYTAU_FUZZ_SECONDS is not set")
def test_random_calls_for_long():
    for model in MAKERS:
        program(model)
    end = time.monotonic() + SECONDS
    for seed in itertools.count(int(time.time())):
        for model in MAKERS:
            assert fuzz(model, seed) == (0, ""), f"{model}, seed {seed}"
            if time.monotonic() > end:
                return
