"""Random equations: every route finds a solution that there is, that of the start where there is one only, or refuses.

GANTRYTAU_ROUTES=1000 for the nightly size.
"""

import os
from pathlib import Path

import numpy as np
import pytest

from gantrytau import GantryTauError, translate
from tests.independent_routes.cells import GRAMMARS, Cell
from tests.independent_routes.routes import answers

MODELS = int(os.environ.get("GANTRYTAU_ROUTES", "40"))
SHARES = {"piecewise": 0.4, "scaled": 0.3, "curved": 0.3}
EVERY = 4  # model as an FMU, which takes as long as all other routes together
CLOSE = 1e-7  # of the size of an unknown
FEW = {
    "piecewise": 0.05,
    "scaled": 0.15,
    "curved": 0.05,
}  # of the answers may be refusals; scaled starts may be singular


@pytest.mark.parametrize("grammar", SHARES)
def test_all_routes_agree_or_refuse(grammar, tmp_path):
    wrong, refused, asked = [], [], 0
    for seed in range(round(MODELS * SHARES[grammar])):
        cell = GRAMMARS[grammar](np.random.default_rng(seed))
        bad, missing, count = judged(cell, tmp_path / str(seed), fmu=seed % EVERY == 0)
        wrong += [f"seed {seed}, {cell.text}: {line}" for line in bad]
        refused += [f"seed {seed}, {cell.text}: {line}" for line in missing]
        asked += count
    assert not wrong, f"{len(wrong)} of {asked} wrong:\n" + "\n".join(wrong)
    assert len(refused) <= FEW[grammar] * asked, f"{len(refused)} of {asked} refused:\n" + "\n".join(refused)


def judged(cell: Cell, folder: Path, *, fmu: bool) -> tuple[list[str], list[str], int]:
    """Wrong answers, refusals of what has one solution all the way from the start, and how many there were."""
    known = [(u, found) for u in cell.points if (found := cell.solutions(u)) is not None]
    if not known:
        return [], [], 0
    folder.mkdir()  # of its own: a library stays loaded
    try:
        dae = translate(cell.model())
    except GantryTauError as error:
        return [], [f"not translated: {error}"] * len(known), len(known)
    found = answers(dae, [{"u": u} for u, _ in known], ["x"], folder, fmu=fmu)
    wrong, refused = [], []
    for route, values in found.items():
        for (u, solutions), x in zip(known, values, strict=True):
            told = f"{route} at u = {u.tolist()}: {x.tolist()}, solutions {solutions.tolist()}"
            if not np.all(np.isfinite(x)):
                sure = len(solutions) == 1 and reachable(cell, u)
                refused += [told] if sure else []
            elif not len(solutions) or np.min(np.abs((solutions - x) / cell.size).max(axis=1)) > CLOSE * (
                1 + np.abs(x / cell.size).max()
            ):
                wrong.append(told)
    return wrong, refused, len(known) * len(found)


def reachable(cell: Cell, end: np.ndarray) -> bool:
    """Whether there is one solution all along the straight way on which the branch of the start is followed."""
    begin = cell.points[0]
    way = (cell.solutions(begin + share * (end - begin)) for share in np.linspace(0.0, 1.0, 60))
    return all(found is not None and len(found) == 1 for found in way)
