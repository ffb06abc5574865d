"""The table of mistakes by procedure on the page: no cell is empty, and what no test of a procedure asks is asked here.

Calls take below half a second but for friction, whose robot is translated in 2 s.
"""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from gantrytau import Samples
from gantrytau_optimica import (
    Experiment,
    Free,
    estimate,
    identify,
    identify_friction,
    identify_servo,
    identify_system,
)
from tests.optimica.estimation.test_fit_diagnostics import TRUE, Decay, T, noise
from tests.optimica.identification.measured.test_system_and_servo_findings import outputs, step
from tests.optimica.identification.rigid import axes
from tests.optimica.identification.test_identify_friction import MASS, ROBOT, SPEEDS, TABLE_6_1, poses, runs

PAGE = Path(__file__).parents[3] / "optimica" / "README.md"
ROWS, (_, SPEED, _) = np.arange(axes.ROWS), axes.motion()


def table() -> dict[tuple[str, str], str]:
    """Cells of the page by mistake and procedure."""
    lines = PAGE.read_text().partition("| mistake |")[2].partition("\n\n")[0].splitlines()
    heads, _, *rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return {(row[0], head): cell for row in rows for head, cell in zip(heads, row[1:], strict=True)}


def of_axes(*extras, **more):
    return identify(axes.two(), [axes.log(k, extra=extra, **more) for k, extra in enumerate(extras)])


def of_runs(extra, positions=5):
    """Runs at constant speed at some positions, with a force more by number and run."""
    sound = runs(poses()[:positions], *TABLE_6_1, np.random.default_rng(0), ripple=2.0, speeds=SPEEDS[::3])
    return identify_friction(ROBOT, [replace(r, f=r.f + extra(k, r)) for k, r in enumerate(sound)], mass=MASS)


def of_steps():
    """Steps of which the readings of one are noisy."""
    loud = step(0.04, 1)
    loud = replace(loud, position=loud.position + 2e-3 * np.random.default_rng(7).normal(size=(300, 1)))
    return identify_servo([step(0.02, 0), step(0.04, 1), loud, step(0.03, 3)])


def of_outputs():
    u, y = outputs(0)
    y[[300, 900]] += 2.0
    return identify_system(u, y, order=2, period=0.01)


def of_experiments():
    data = [Samples(T, TRUE + (0.08 if k == 1 else 0.01) * noise(k)) for k in range(4)]
    return estimate(Decay, {"k": Free(1.0)}, [Experiment({"x": one}) for one in data], elements=10)


NOISY = 5.0 * np.random.default_rng(9).normal(size=SPEED.shape)
# friction rises in the second half
GRIPS = cache(lambda: of_axes(20 * np.sign(SPEED) * (axes.T > 10)[:, None]))
STRAY = cache(lambda: of_runs(lambda k, r: 60.0 * (k == 7), 3))
CELLS = {
    ("wrong model", "identify", "not white"): GRIPS,
    ("strays", "identify", "outliers"): lambda: of_axes(300.0 * (ROWS % 1700 == 700)[:, None]),
    ("drift", "identify", "held out"): GRIPS,
    ("one bad group", "identify", "group"): lambda: of_axes(0.0, NOISY, 0.0),
    ("wrong model", "identify_friction", "trend"): lambda: of_runs(lambda k, r: 40 * (r.q[0] - 2)),
    ("strays", "identify_friction", "outliers"): STRAY,
    ("one bad group", "identify_friction", "outliers"): STRAY,
    ("drift", "identify_friction", "trend"): lambda: of_runs(lambda k, r: 1.0 * k, 3),
    ("one bad group", "identify_servo", "group"): of_steps,
    ("strays", "identify_system", "outliers"): of_outputs,
    ("one bad group", "estimate", "group"): of_experiments,
}  # fmt: skip


@pytest.mark.parametrize(("mistake", "procedure", "kind"), CELLS)
def test_a_mistake_is_told_as_the_page_says(mistake, procedure, kind):
    assert kind in table()[mistake, procedure]
    found = CELLS[mistake, procedure, kind]()
    told = found.diagnostics.findings if procedure == "estimate" else found.findings
    assert kind in {finding.kind for finding in told}


def test_no_cell_is_empty():
    cells = table()
    assert len(cells) == 10 * 7
    assert all(cells.values())
    assert {k for k, cell in cells.items() if cell == "none yet"} <= {("noise other than told", "calibrate")}
