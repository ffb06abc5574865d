"""Random chains of joints, at quarter turns above all: accelerations on five ways, and by Newton and Euler in NumPy."""

from pathlib import Path

import numpy as np

from gantrytau import Dae, SolveError, simulate, translate
from tests.fmu.exported import export
from tests.independent_routes.linkages import (
    Linkage,
    accelerations,
    led,
    model_of,
    random_linkage,
    random_pose,
)
from tests.independent_routes.routes import COMPILER, Point, called, compiled, flat, initialised, or_none
from tests.independent_routes.test_cells import EVERY, MODELS

SHARE = 0.2  # of the random models
CLOSE = 1e-7  # of the largest acceleration
USUAL = (0.5, 1.0, 2.0)  # kg
SOME = 0.2  # of the answers may be refusals where bodies have 1e-12 kg or 6e24 kg


def test_all_routes_give_the_accelerations_of_newton_and_euler(tmp_path):
    wrong, refused, unusual, asked = [], [], [], 0
    for seed in range(round(MODELS * SHARE)):
        rng = np.random.default_rng(seed)
        linkage = random_linkage(rng)
        folder = tmp_path / str(seed)
        folder.mkdir()
        for route, found, expected in compared(linkage, rng, folder, fmu=seed % EVERY == 0):
            asked += 1
            told = f"seed {seed}, {linkage.kinds}, closed {linkage.closed}, {route}: {found}, expected {expected}"
            if not np.all(np.isfinite(found)):
                (unusual if linkage.masses.max() not in USUAL else refused).append(told)
            elif np.abs(found - expected).max() > CLOSE * (1 + np.abs(expected).max()):
                wrong.append(told)
    assert not wrong, f"{len(wrong)} of {asked} wrong:\n" + "\n".join(wrong)
    assert not refused, f"{len(refused)} of {asked} refused:\n" + "\n".join(refused)
    assert len(unusual) <= SOME * asked, f"{len(unusual)} of {asked} refused:\n" + "\n".join(unusual)


def compared(linkage: Linkage, rng: np.random.Generator, folder: Path, *, fmu: bool):
    """Route, accelerations found and expected, for poses far from the start and at it."""
    n = len(linkage.kinds)
    find = [f"der({name})" for name in linkage.speeds]
    nothing = np.full(n, np.nan)
    dae = or_none(translate, model_of(linkage, linkage.start, np.zeros(n)))
    if dae is None:
        yield "translate", nothing, nothing
        return
    function = or_none(dae.function, [*dae.states, *linkage.drives], find)
    binary = None if function is None or COMPILER is None else compiled(function, folder)
    for number in range(2):
        pose = some_pose(linkage, dae, rng)
        if pose is None:
            continue
        q, v = pose
        tau = rng.normal(size=n).round(1) * linkage.masses.max()
        expected = accelerations(linkage, q, v, tau)
        values = dict(zip(linkage.coordinates, q, strict=True)) | dict(zip(linkage.speeds, v, strict=True))
        drives = dict(zip(linkage.drives, tau, strict=True))
        point: Point = {name: np.array(values[name]) for name in dae.states} | drives
        yield f"function {q.tolist()}", called(function, list(point), point), expected
        if binary is not None:
            yield f"C {q.tolist()}", called(binary, list(point), point), expected
        yield (
            f"evaluate {q.tolist()}",
            evaluated(dae, point, find),
            expected,
        )
        there = or_none(translate, model_of(linkage, q, v))
        if there is None:
            yield f"translate {q.tolist()}", nothing, expected
            continue
        yield f"simulate {q.tolist()}", begun(there, drives, find), expected
        if fmu and number == 0 and COMPILER is not None:
            exported = or_none(export, there, folder / "model.fmu", find=find)
            yield f"FMU {q.tolist()}", initialised(exported, there, drives, find), expected


def some_pose(linkage: Linkage, dae: Dae, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray] | None:
    """Consistent positions and speeds."""
    n = len(linkage.kinds)
    if not linkage.closed:
        return random_pose(rng, n), rng.normal(size=n).round(1)
    independent = [k for k, name in enumerate(linkage.coordinates) if name in dae.states]
    change = rng.choice([0.0, 0.4, -0.7, np.pi / 2], len(independent))
    return led(linkage, independent, change, rng.normal(size=len(independent)).round(1))


def begun(dae: Dae, drives: dict[str, float], find: list[str]) -> np.ndarray:
    """What a simulation has at its start."""
    try:
        result = simulate(dae, stop=1e-3, points=2, inputs=drives)
    except SolveError as error:
        result = error.result
    return np.full(len(find), np.nan) if result is None else flat([result[name][0] for name in find])


def evaluated(dae: Dae, point: Point, find: list[str]) -> np.ndarray:
    """What `evaluate` says."""
    values = or_none(dae.evaluate, point)
    return np.full(len(find), np.nan) if values is None else flat([values[name] for name in find])
