"""What random models of each family are asked: routes to an answer, and all that would be right.

A family takes a seed and a folder and yields questions; none where it is not sure what is right.
"""

import functools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau import Dae, GantryTauError, SolveError, simulate, translate
from gantrytau_fmu import export_fmu
from gantrytau_fmu.systems.run_fmu import run_fmu
from tests.families import NIGHTLY
from tests.fmu.exported import export
from tests.independent_routes import delayed_motions, hybrid_motions, sampled_laws, switching_motions
from tests.independent_routes import thrown_motions as thrown
from tests.independent_routes.cells import Cell
from tests.independent_routes.linkages import (
    Linkage,
    accelerations,
    led,
    model_of,
    random_linkage,
    random_pose,
)
from tests.independent_routes.mixed_equations import random_mixed
from tests.independent_routes.routes import (
    COMPILER,
    Answer,
    answers,
    attempted,
    called,
    compiled,
    flat,
    initialised,
)

EVERY = 20 if NIGHTLY else 4  # model as an FMU, which takes as long as all other routes together
USUAL = (0.5, 1.0, 2.0)  # kg


@dataclass(frozen=True, eq=False)
class Asked:
    """An answer, or its refusal, beside all solutions, each as long as the answer.

    close: of the size of the answer, where `size` is that of each of its elements; has_one: whether a refusal counts, as
    there is one solution all the way from the start; refusal: the words in which what has no solution has to be refused.
    """

    text: str
    answer: Answer
    solutions: list[np.ndarray]
    close: float
    size: Any = 1.0
    has_one: Callable[[], bool] = lambda: True
    refusal: str | None = None
    whole: tuple[int, ...] = ()  # elements that are whole numbers, exact to 1e-9

    def verdict(self) -> str:
        """One of equal, rightly refused, refused, and wrong."""
        if isinstance(self.answer, GantryTauError):
            as_told = self.refusal is not None and not self.solutions and self.refusal in str(self.answer)
            return "refused" if not as_told and self.has_one() else "rightly refused"
        whole = list(self.whole)
        meant = [s for s in self.solutions if np.all(np.abs(s[whole] - self.answer[whole]) <= 1e-9)]
        apart = [np.abs((s - self.answer) / self.size).max() for s in meant]
        most = self.close * (1 + np.abs(self.answer / self.size).max())
        return "equal" if apart and min(apart) <= most else "wrong"


Family = Callable[[int, Path], Iterator[Asked]]


def cells(make: Callable[[np.random.Generator], Cell], seed: int, folder: Path) -> Iterator[Asked]:
    """Every route finds a solution that there is, that of the start where there is one only."""
    cell = make(np.random.default_rng(seed))
    known = [(u, list(found)) for u in cell.points if (found := cell.solutions(u)) is not None]
    if not known:
        return
    dae = attempted(translate, cell.model())
    given = [{"u": u} for u, _ in known]
    if isinstance(dae, GantryTauError):
        found = {"translate": [dae] * len(known)}
    else:
        found = answers(dae, given, ["x"], folder, fmu=seed % EVERY == 0)
    for route, values in found.items():
        for (u, solutions), x in zip(known, values, strict=True):
            text = f"{route} at u = {u.tolist()}, {cell.text}"
            has_one = functools.partial(_reachable, cell, u, len(solutions))
            yield Asked(text, x, solutions, 1e-7, cell.size, has_one)


def _reachable(cell: Cell, end: np.ndarray, solutions: int) -> bool:
    """Whether there is one solution all along the straight way on which the branch of the start is followed."""
    begin = cell.points[0]
    way = [begin + share * (end - begin) for share in np.linspace(0.0, 1.0, 61)]
    known = (cell.solutions(u) for u in way)
    return (
        solutions == 1
        and len({np.sign(cell.side(u)) for u in way}) == 1
        and all(found is not None and len(found) == 1 for found in known)
    )


def linkages(usual: bool, seed: int, folder: Path) -> Iterator[Asked]:
    """Accelerations of poses far from the start and at it.

    usual: bodies of 0.5 to 2 kg only, else of 1e-12 kg or 6e24 kg as well.
    """
    rng = np.random.default_rng(seed)
    linkage = random_linkage(rng)
    if usual and linkage.masses.max() not in USUAL:
        return
    n = len(linkage.kinds)
    find = [f"der({name})" for name in linkage.speeds]
    text = f"{linkage.kinds}, closed {linkage.closed}"
    dae = attempted(translate, model_of(linkage, linkage.start, np.zeros(n)))
    if isinstance(dae, GantryTauError):
        yield Asked(f"translate, {text}", dae, [], 0.0)
        return
    function = attempted(dae.function, [*dae.states, *linkage.drives], find)
    binary = compiled(function, folder) if COMPILER and not isinstance(function, GantryTauError) else None
    for number in range(2):
        pose = _some_pose(linkage, dae, rng)
        if pose is None:
            continue
        q, v = pose
        tau = rng.normal(size=n).round(1) * linkage.masses.max()
        values = dict(zip(linkage.coordinates, q, strict=True)) | dict(zip(linkage.speeds, v, strict=True))
        drives = dict(zip(linkage.drives, tau, strict=True))
        point = {name: np.array(values[name]) for name in dae.states} | drives
        found = {
            "function": attempted(called, function, list(point), point),
            "evaluate": attempted(lambda point=point: flat([dae.evaluate(point)[name] for name in find])),
        }
        if binary is not None:
            found["C"] = attempted(called, binary, list(point), point)
        there = attempted(translate, model_of(linkage, q, v))
        if isinstance(there, GantryTauError):
            found["translate"] = there
        else:
            found["simulate"] = attempted(_begun, there, drives, find)
            if seed % EVERY == 0 and number == 0 and COMPILER:
                exported = attempted(export, there, folder / "model.fmu", find=find)
                found["FMU"] = attempted(initialised, exported, there, drives, find)
        expected = accelerations(linkage, q, v, tau)
        for route, answer in found.items():
            yield Asked(f"{route} at {q.tolist()}, {text}", answer, [expected], 1e-7)


def _some_pose(linkage: Linkage, dae: Dae, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray] | None:
    """Consistent positions and speeds."""
    n = len(linkage.kinds)
    if not linkage.closed:
        return random_pose(rng, n), rng.normal(size=n).round(1)
    independent = [k for k, name in enumerate(linkage.coordinates) if name in dae.states]
    change = rng.choice([0.0, 0.4, -0.7, np.pi / 2], len(independent))
    return led(linkage, independent, change, rng.normal(size=len(independent)).round(1))


def _begun(dae: Dae, drives: dict[str, float], find: list[str]) -> np.ndarray:
    """What a simulation has at its start."""
    try:
        result = simulate(dae, stop=1e-3, points=2, inputs=drives)
    except SolveError as error:
        if error.result is None:
            raise
        result = error.result
    return flat([result[name][0] for name in find])


def _finals(find: tuple[str, ...], model: Any, **options: Any) -> np.ndarray:
    result = simulate(model, **options)
    return flat([result.final(name) for name in find])


def _by_fmu(find: tuple[str, ...], file: Path, **options: Any) -> np.ndarray:
    result = run_fmu(file, **options)
    return flat([result.final(name) for name in find])


def delayed(seed: int, folder: Path, *, fmu: bool = False) -> Iterator[Asked]:
    """A motion with a delay ends where the method of steps ends."""
    motion = delayed_motions.random_delayed(np.random.default_rng(seed))
    tolerance, stop = 1e-10, delayed_motions.END
    close = 1e3 * tolerance  # an integrator begins anew at each place that is remembered
    options: dict[str, Any] = dict(stop=stop, tolerance=tolerance)
    if fmu:
        file = folder / "model.fmu"
        export_fmu(motion.model(), file, tolerance=tolerance)
        for step in (0.5, 0.01):
            end = attempted(_by_fmu, ("x",), file, step=step, **options)
            yield Asked(f"steps of {step:g} s, {motion.text}", end, [motion.end], close)
    else:
        points = 2 if seed % 2 else 101
        end = attempted(_finals, ("x",), motion.model(), points=points, **options)
        yield Asked(f"{points} points, {motion.text}", end, [motion.end], close)


def hybrid(seed: int, folder: Path, *, fmu: bool = False) -> Iterator[Asked]:
    """A motion with whens ends where the exact solution ends; d is a whole number."""
    motion = hybrid_motions.random_hybrid(np.random.default_rng(seed))
    if motion.end is None:
        return
    x, d, _ = motion.end
    tolerance = 1e-10  # events magnify errors: a motion that hardly crosses a margin crosses it late
    options: dict[str, Any] = dict(stop=hybrid_motions.END, tolerance=tolerance)
    found = {}
    if fmu:
        file = folder / "model.fmu"
        export_fmu(motion.model(), file, tolerance=tolerance)
        for step, exchange in ((0.5, False), (0.01, False), (0.01, True)):
            text = f"steps of {step:g} s, Model Exchange {exchange}"
            found[text] = attempted(_by_fmu, ("x", "d"), file, step=step, model_exchange=exchange, **options)
    else:
        points = 2 if seed % 2 else 101
        dae = translate(motion.model(), events=True)
        found[f"{points} points"] = attempted(_finals, ("x", "d"), dae, points=points, **options)
    for text, end in found.items():
        yield Asked(f"{text}, {motion.text}", end, [np.append(x, d)], 1e4 * tolerance, whole=(-1,))


def switching(seed: int, folder: Path, *, dense: bool = False) -> Iterator[Asked]:
    """A motion that switches ends where the exact solution ends, whatever points are asked for.

    dense: switches on sines of states.
    """
    shapes = ("sine", "kink") if dense else tuple(switching_motions.SHAPES)
    tolerance = 1e-10 if dense else 1e-8  # each of many starts anew adds an error
    motion = switching_motions.random_motion(np.random.default_rng(seed), shapes)
    if motion.end is None or (dense and "sine" not in motion.text):
        return
    dae, inputs = translate(motion.model()), {"f": switching_motions.pulse_of_time(motion.pulse)}
    for points in (2, 11, 501):
        options: dict[str, Any] = dict(stop=switching_motions.END, points=points, inputs=inputs)
        end = attempted(_finals, ("x",), dae, tolerance=tolerance, **options)
        yield Asked(f"{points} points, {motion.text}", end, [motion.end], 1e-6)


def sampled(seed: int, folder: Path, *, fmu: bool = False) -> Iterator[Asked]:
    """A sampled law with limits takes what was before its instants."""
    law, find, stop = sampled_laws.random_law(np.random.default_rng(seed)), ("x", "s", "d"), sampled_laws.END
    if law.end is None:
        return
    if not fmu:
        points = 2 if seed % 2 else 101
        options: dict[str, Any] = dict(stop=stop, points=points, tolerance=1e-9, inputs={"r": law.r})
        yield Asked(
            f"{points} points, {law.text}", attempted(_finals, find, law.model(), **options), [law.end], 1e-6
        )
        return
    file = folder / "model.fmu"
    export_fmu(law.model(), file, fmi="2.0" if seed % 2 else "3.0", tolerance=1e-9, find=list(find))
    for step, exchange in ((0.05, False), (0.01, False), (0.05, True)):
        more = 0.0 if exchange else step  # what is due at the end of a step is sampled by the next one

        def end(step: float = step, exchange: bool = exchange, more: float = more) -> np.ndarray:
            found = run_fmu(
                file,
                stop=stop + more,
                step=step,
                tolerance=1e-9,
                model_exchange=exchange,
                inputs={"r": law.r},
            )
            return flat([found["x"][-1 if exchange else -2], found["s"][-1], found["d"][-1]])

        # an importer's integrator begins anew at each instant
        text = f"steps of {step:g} s, Model Exchange {exchange}, {law.text}"
        yield Asked(text, attempted(end), [law.end], 1e-4 if exchange else 1e-6)


def thrown_by_signals(seed: int, folder: Path, *, fmu: bool = False) -> Iterator[Asked]:
    """What a piecewise signal that is differentiated throws moves as balances say; infinite jumps are refused."""
    motion = thrown.random_thrown(np.random.default_rng(seed))
    tolerance = 1e-10
    close = 1e5 * tolerance  # three pendulums magnify errors
    options: dict[str, Any] = dict(stop=thrown.END, tolerance=tolerance)
    found = {}
    if not fmu:
        points = (2, 101)[seed % 2]
        known = [] if motion.way == "equation" or motion.signal is None else ["s"]
        inputs = dict.fromkeys(known, motion.signal.write) if motion.signal else {}
        dae = translate(motion.model(), given=known if motion.way == "given" else [])
        found[f"{points} points"] = attempted(
            _finals, motion.find, dae, points=points, inputs=inputs, **options
        )
    elif motion.way == "equation" and motion.end is not None:
        file = folder / "model.fmu"
        export_fmu(motion.model(), file, tolerance=tolerance, fmi="2.0" if seed % 2 else "3.0")
        for exchange in (False, True):
            found[f"Model Exchange {exchange}"] = attempted(
                _by_fmu, motion.find, file, step=0.02, model_exchange=exchange, **options
            )
    solutions = [] if motion.end is None else [motion.end]
    for text, end in found.items():
        yield Asked(f"{text}, {motion.text}", end, solutions, close, refusal="more than an impulse")


def mixed(seed: int, folder: Path) -> Iterator[Asked]:
    """A system of index 3 whose derivatives cancel between equations moves as its closed form says."""
    equations, tolerance = random_mixed(seed), 1e-9
    end = attempted(_finals, ("w",), equations.model(), stop=1.0, points=3, tolerance=tolerance)
    yield Asked("mixed", end, [equations.motion(1.0)], 1e3 * tolerance)
