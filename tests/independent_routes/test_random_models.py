"""Random models, a family after another: every route is right, or refuses what it may.

GANTRYTAU_NIGHTLY=1 asks a thousand of them, GANTRYTAU_ROUTES=400 ten times the usual number; pytest -rP shows the counts and
the sentences of refusals.
"""

import os
import re
from collections import Counter
from functools import partial

import numpy as np
import pytest

from tests.families import NIGHTLY
from tests.independent_routes import asked
from tests.independent_routes.cells import GRAMMARS
from tests.independent_routes.hybrid_motions import random_hybrid
from tests.independent_routes.routes import COMPILER

TIMES = int(os.environ.get("GANTRYTAU_ROUTES", "40")) / 40

# what is asked; how many models usually, and nightly; and how many of the answers may be refusals
FAMILIES: dict[str, tuple[asked.Family, int, int, float]] = {
    "thrown": (asked.thrown_by_signals, 10, 250, 0.0),
    "sampled": (asked.sampled, 6, 200, 0.0),
    "mixed": (asked.mixed, 3, 40, 0.0),
    "dense": (partial(asked.switching, dense=True), 1, 25, 0.0),
    "hybrid": (asked.hybrid, 72, 250, 0.0),
    "scaled": (partial(asked.cells, GRAMMARS["scaled"]), 12, 120, 0.05),
    "piecewise": (partial(asked.cells, GRAMMARS["piecewise"]), 16, 100, 0.05),
    "switching": (asked.switching, 6, 50, 0.0),
    "delayed": (asked.delayed, 6, 30, 0.0),
    "curved": (partial(asked.cells, GRAMMARS["curved"]), 12, 15, 0.05),
    "linkages": (partial(asked.linkages, True), 2, 6, 0.0),
    "linkages of any mass": (partial(asked.linkages, False), 8, 16, 0.2),
    "thrown, FMU": (partial(asked.thrown_by_signals, fmu=True), 2, 5, 0.0),
    "sampled, FMU": (partial(asked.sampled, fmu=True), 2, 5, 0.0),
    "hybrid, FMU": (partial(asked.hybrid, fmu=True), 7, 7, 0.0),
    "delayed, FMU": (partial(asked.delayed, fmu=True), 4, 4, 0.0),
}


@pytest.mark.parametrize("family", FAMILIES)
def test_every_route_is_right_or_refuses(family, tmp_path):
    if COMPILER is None and "FMU" in family:
        pytest.skip("no C compiler")
    ask, usual, nightly, few = FAMILIES[family]
    count = nightly if NIGHTLY else max(1, round(usual * TIMES))
    told: dict[str, list[str]] = {"equal": [], "rightly refused": [], "refused": [], "wrong": []}
    sentences: Counter[str] = Counter()
    models = seed = 0
    while models < count:
        folder = tmp_path / str(seed)  # of its own: a library stays loaded
        folder.mkdir()
        questions = list(ask(seed, folder))
        for one in questions:
            verdict = one.verdict()
            told[verdict].append(f"seed {seed}, {one.text}: {one.answer}, expected {one.solutions}")
            if verdict.endswith("refused"):
                sentences[f"{verdict}: " + re.sub(r"-?\d[\d.e+-]*", "#", str(one.answer))] += 1
        models, seed = models + bool(questions), seed + 1
        assert seed < 10 * count + 10, "few models of which it is known what is right"
    wrong, refused, answers = told["wrong"], told["refused"], sum(map(len, told.values()))
    print(family, f"{models} models,", ", ".join(f"{len(lines)} {name}" for name, lines in told.items()))
    print(*(f"{times} {sentence}" for sentence, times in sentences.most_common()), sep="\n")
    assert not wrong, f"{len(wrong)} of {answers} wrong:\n" + "\n".join(wrong)
    assert len(refused) <= few * answers, f"{len(refused)} of {answers} refused:\n" + "\n".join(refused)


def test_random_whens_act():
    motions = [random_hybrid(np.random.default_rng(seed)) for seed in range(20)]
    assert sum(motion.end[2] for motion in motions if motion.end) > 20
