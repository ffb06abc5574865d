"""The reference results of an FMU run again, and compared signal by signal."""

import math
import warnings
from collections.abc import Iterator, Sequence

import numpy as np

from gantrytau import Samples
from gantrytau.border.refusal import GantryTauError
from gantrytau.results.result import Result
from gantrytau.results.tube import ABSOLUTE, RELATIVE, leaves
from gantrytau_fmu.reading.fmu_file import FmuFile
from gantrytau_fmu.reading.fmu_findings import FmuFinding, fault
from gantrytau_fmu.reading.reference_results import ReferenceResults
from gantrytau_fmu.systems.run_fmu import run_fmu

STEPS = 1000  # of an integrator, whose errors add up: `simulate` allows a 500th of its tolerance for one
WIDEST = 0.1  # of a signal's range, whatever the tolerance
HELD = 1e-3  # of an input's range: its change in a step
LONGEST = 20_000  # steps of a rerun
SAME = 1e-9  # of the time of the run


def rerun(fmu: FmuFile, reference: ReferenceResults) -> Iterator[FmuFinding]:
    """Runs the Co-Simulation of an FMU in a process of its own; which signal leaves its reference first, or that none does.

    Tube of own results: a thousand times the tolerance of the experiment high, relative to a signal's range; without width,
    save within a step of an event, where a sample or a jump is seen a step later. Results of other tools: 0.2 %.
    """
    if "co-simulation" not in {each.kind for each in fmu.interfaces}:
        words = "not run again: found no interface for Co-Simulation, expected one; export it with that"
        yield FmuFinding("warning", f"{reference.name}: {words}")
        return
    end, grid = float(reference.time[-1]), _distance(reference.time)
    driven = {name: _driven(*drawn) for name, drawn in reference.inputs.items()}
    lined = [one for one in driven.values() if isinstance(one, Samples) and one.kind == "linear"]
    step = _step(fmu, grid, lined, end)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of inputs that nothing drives
            run = run_fmu(fmu.path, stop=end, step=step, inputs=driven, isolate=True)
    except GantryTauError as error:
        yield fault(f"{reference.name}: found no end when it was run again, expected {end:g} s: {error}")
        return
    compared = [name for name in reference.values if name in run]
    left = sorted(
        (float(when[0]), name, float(by[0]), float(by.max()))
        for name in compared
        for when, by in [_left(fmu, reference, run, name, step)]
        if when.size
    )
    high = _height(fmu, reference)[0]
    if not left:
        several = "" if len(compared) == 1 else "s"
        words = f"run again, {len(compared)} signal{several} over {end:g} s within {high:g} of the range"
        yield FmuFinding("note", f"{reference.name}: {words}")
        return
    when, name, by, most = left[0]
    there = np.searchsorted(reference.time, when)
    expected, unit = reference.values[name][there], fmu.by_name[name].unit if name in fmu.by_name else ""
    words = (
        f"{name} leaves its reference at t = {when:.6g} s by {by:.3g} {unit}".rstrip()
        + f" (later by up to {most:.3g}; {len(left)} of {len(compared)} signals leave)"
        + f", expected {expected:.6g} within {high:g} of its range; the FMU is not what its author ran: get it from there"
        " again, or export it with a reference of these equations"
        + (", of more points: its inputs are joined by lines" if lined else "")
    )
    yield FmuFinding("error" if reference.own else "warning", f"{reference.name}: {words}")


def _distance(time: np.ndarray) -> float:
    """The distance of output times, s: events between them are few."""
    end = float(time[-1])
    found = max(float(np.median(np.diff(np.unique(time)))), end / LONGEST)
    count = round(end / found)
    return end / count if abs(end / found - count) < SAME * count else found


def _step(fmu: FmuFile, grid: float, lined: Sequence[Samples], end: float) -> float:
    """A step that divides the distance of output times, no longer than the experiment's.

    An FMU that samples holds the inputs of the beginning of a step: they change by 0.1 % of their range in one at most.
    """
    parts = grid / (fmu.experiment.step or grid)
    if any(v.variability == "discrete" and v.real and v.causality != "input" for v in fmu.variables):
        parts = max(
            [parts, *(np.abs(np.diff(u.values[:, 0])).max() / np.ptp(u.values) / HELD for u in lined)]
        )
    return grid / max(min(math.ceil(parts * (1 - SAME)), math.floor(LONGEST * grid / end)), 1)


def _driven(time: np.ndarray, values: np.ndarray) -> Samples | float:
    """A column as an input: a number, held between jumps at double times, or linear with steep jumps."""
    if np.ptp(values) == 0.0:
        return float(values[0])
    last = np.append(np.diff(time) > 0, True)
    if not np.any(np.diff(values)[last[:-1]]):
        return Samples(time[last], values[last], kind="constant")
    first = np.insert(np.diff(time) > 0, 0, True)
    ends = first | last  # of three at one time, the first and the last
    moved = time - SAME * time[-1] * (first & ~last)
    ends &= moved >= 0
    return Samples(moved[ends], values[ends])


def _height(fmu: FmuFile, reference: ReferenceResults) -> tuple[float, float]:
    """Half heights of the tube, shares of the range and of the largest value."""
    tolerance = fmu.experiment.tolerance
    if not reference.own or tolerance is None:
        return RELATIVE, ABSOLUTE
    return min(STEPS * tolerance, WIDEST), tolerance


def _left(
    fmu: FmuFile, reference: ReferenceResults, run: Result, name: str, step: float
) -> tuple[np.ndarray, np.ndarray]:
    """When a signal is outside of its tube, and by how much."""
    relative, absolute = _height(fmu, reference)
    variable = fmu.by_name.get(name)
    nominal = (variable and variable.nominal) or 1.0
    time, expected, policy = (
        reference.time,
        reference.values[name],
        {"relative": relative, "absolute": absolute},
    )
    if not reference.own:
        return leaves(run.time, run[name], time, expected, nominal, **policy)
    small = SAME * time[-1]
    known = np.abs(time - step * np.round(time / step)) <= small  # at points of the rerun
    twice = np.diff(time) == 0
    jumps = twice | np.isin(np.arange(1, time.size), reference.jumps)
    kept = known | ~(np.append(twice, False) | np.insert(twice, 0, False))
    kept[-1] &= not jumps[-1]  # a sample at the end would be seen after it
    near = _near(time, jumps, step + small) | ~known
    wide = np.where(near, step + small, small)[kept]
    when, by = leaves(run.time, run[name], time[kept], expected[kept], nominal, **policy, wide=wide)
    # behind a jump that is seen a step later, the signal has gone on by then
    close = [np.abs(run.time - t) <= step + small for t in when]
    later = by > np.array([np.ptp(run[name][one]) if one.any() else 0.0 for one in close])
    left = later | ~np.isin(when, time[near])
    return when[left], by[left]


def _near(time: np.ndarray, jumps: np.ndarray, step: float) -> np.ndarray:
    """Which times are within a step of an event or the end."""
    events = np.sort(np.concatenate([time[np.append(jumps, True)], time[np.insert(jumps, 0, False)]]))
    after = np.clip(np.searchsorted(events, time), 0, events.size - 1)
    return np.minimum(abs(events[after] - time), abs(time - events[np.maximum(after - 1, 0)])) <= step
