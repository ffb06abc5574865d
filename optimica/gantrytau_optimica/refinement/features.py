"""What distinguishes motions from each other, in the model's words: sides of the straight line, speeds that change sign,
inputs that change between their limits, and in which order.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import casadi as ca
import numpy as np

from gantrytau import ModelError
from gantrytau.simulation.to_result import labels
from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.answers.playback.ranges import measured
from gantrytau_optimica.answers.playback.switches import sides
from gantrytau_optimica.control.limits import signal_limits
from gantrytau_optimica.refinement.guess_family import coordinates, vector_of
from gantrytau_optimica.transcription.trajectory import Trajectory

SAMPLES = 201  # of a motion
BESIDE = 0.02  # of the way: what is less beside the straight line is on it
STILL = 0.02  # of its largest speed: below, a sign is that of nothing
REACHED = 0.01  # of its range: what is closer to a limit is at it
ENOUGH = 3  # features that are told of each
SPEEDS = ("m/s", "rad/s")


@dataclass(frozen=True)
class Feature:
    """One thing that can be said of a motion: `value` is compared, `words` are told."""

    value: tuple[object, ...]
    words: str


def distinctions(motions: Sequence[Optimum]) -> list[str]:
    """For each motion what tells it from the others; nothing where there is only one."""
    if len(motions) < 2:
        return ["" for _ in motions]
    chosen: list[list[Feature]] = []
    for features in _features(motions):
        if len({f.value for f in features}) > 1:
            chosen.append(features)
        if len(chosen) == ENOUGH:
            break
    return ["; ".join(filter(None, (one[k].words for one in chosen))) for k in range(len(motions))]


def _features(motions: Sequence[Optimum]) -> Iterator[list[Feature]]:
    """The same feature of all motions, one feature after the other, what is seen first first."""
    for path, phase in motions[0].phases.items():
        vectors = dict.fromkeys(vector_of(s.name) for s in coordinates(phase.phase))
        for vector in vectors:
            yield [_side(motion, path, vector) for motion in motions]
        yield from _counted(motions, path, _speeds, "changes its sign")
        yield from _counted(motions, path, _limited, "changes between its limits")
        yield [_order(motion, path) for motion in motions]


def _side(motion: Optimum, path: str, vector: str) -> Feature:
    """On which side of the straight line between its ends a vector passes, or how far beyond its ends a scalar goes."""
    trajectory = motion.phases[path]
    states = [s for s in coordinates(trajectory.phase) if vector_of(s.name) == vector]
    rows = _sampled(trajectory, ca.vertcat(*(s.symbol for s in states)))
    way = rows[:, -1] - rows[:, 0]
    size = max(float(np.linalg.norm(way)), float(np.linalg.norm(np.ptp(rows, axis=1))) / 2)
    unit = labels(motion.dae)[0].get(states[0].name, "")
    length = float(np.linalg.norm(way))
    if len(states) == 1:
        beyond = _beyond(rows[0])
        if abs(beyond) <= BESIDE * size:
            return Feature((0,), f"{vector} stays between its ends")
        side = "above" if beyond > 0 else "below"
        return Feature((side,), f"{vector} goes {abs(beyond):.2g} {unit} {side} its ends".replace("  ", " "))
    ahead = way / length if length > BESIDE * size else np.zeros(len(states))
    beside = rows - rows[:, :1]
    beside = beside - np.outer(ahead, ahead @ beside)
    far = np.linalg.norm(beside, axis=0)
    worst = beside[:, int(np.argmax(far))]
    if np.max(far) <= BESIDE * size:
        return Feature((0,), f"{vector} keeps to the straight line")
    k = int(np.argmax(np.abs(worst)))
    sign = "+" if worst[k] > 0 else "-"
    words = (
        f"{vector} passes {np.max(far):.2g} {unit} beside the straight line, towards {sign}{states[k].name}"
    )
    return Feature((k, sign), words.replace("  ", " "))


def _beyond(row: np.ndarray) -> float:
    """How far a scalar goes above (positive) or below its ends, the larger of both."""
    above, below = np.max(row) - max(row[0], row[-1]), min(row[0], row[-1]) - np.min(row)
    return float(above if above >= below else -below)


def _sampled(trajectory: Trajectory, expressions: ca.SX) -> np.ndarray:
    return trajectory.values(expressions, trajectory.times(np.linspace(0.0, 1.0, SAMPLES)))


def _counted(
    motions: Sequence[Optimum], path: str, rows: Callable[[Optimum, str], dict[str, np.ndarray]], verb: str
) -> Iterator[list[Feature]]:
    """How often something of each motion changes its sign: of the first kind that differs, where the numbers differ most."""
    signs = [rows(motion, path) for motion in motions]
    counts = {
        name: [_changes(one[name]) for one in signs] for name in signs[0] if all(name in one for one in signs)
    }
    if not counts:
        return
    states = {s.name for s in motions[0].phases[path].phase.states}
    told = [signs[0][name] for name in states & signs[0].keys()]
    same = {name for name in counts if any(np.array_equal(signs[0][name], one) for one in told)}

    def telling(name: str) -> tuple[bool, bool, int, int]:
        """What differs, what is not told by the side on which a state passes, by how much, what has the shortest name."""
        spread = max(counts[name]) - min(counts[name])
        return spread > 0, name not in same, spread, -len(name)

    name = max(counts, key=telling)
    yield [Feature((count,), f"{name} {_times(verb, count)}") for count in counts[name]]


def _times(verb: str, count: int) -> str:
    if not count:
        return f"never {verb}"
    return f"{verb} once" if count == 1 else f"{verb} {count} times"


def _changes(signs: np.ndarray) -> int:
    """How often signs change from one side to the other, zeros left out."""
    kept = signs[signs != 0]
    return int(np.count_nonzero(np.diff(kept)))


def _speeds(motion: Optimum, path: str) -> dict[str, np.ndarray]:
    """Signs of all speeds of the model in a phase, each under its shortest name."""
    units = labels(motion.dae)[0]
    inside = f"{path}." if path else ""
    names = sorted(
        (n for n in motion.dae.variables if units.get(n) in SPEEDS and n.startswith(inside)), key=len
    )
    known: dict[str, np.ndarray] = {}
    for name in names:
        try:
            row = _sampled(motion.phases[path], motion.built.expressed([name]))[0]
        except ModelError:  # of what the problem does not hold
            continue
        signs = np.where(np.abs(row) > STILL * np.max(np.abs(row), initial=0.0), np.sign(row), 0.0)
        known[name] = signs
    return known


def _limited(motion: Optimum, path: str) -> dict[str, np.ndarray]:
    """Sides of what has a lower and an upper limit and is an input, or depends on one: -1, 0 or 1."""
    trajectory = motion.phases[path]
    phase, found = trajectory.phase, {}
    limits = signal_limits(phase, trajectory.problem.name)
    rows = {s.name: (s.symbol, *limits[s.name]) for s in phase.inputs}
    for name, (symbol, low, high) in rows.items():
        if np.isfinite(low) and np.isfinite(high):
            found[name] = _at_limit(trajectory.values(symbol, trajectory.time)[0], low, high)
    symbols = ca.vertcat(ca.SX(0, 1), *(s.symbol for s in (*phase.inputs, *phase.algebraics)))
    values = partial(_at_points, trajectory)
    for limit, row, _ in measured(trajectory, values):
        two = np.isfinite(limit.lower) and np.isfinite(limit.upper) and limit.lower < limit.upper
        if two and len(ca.symvar(limit.expression)) > 1 and ca.depends_on(limit.expression, symbols):
            found[limit.name] = _at_limit(row, limit.lower, limit.upper)
    return found


def _at_points(trajectory: Trajectory, expressions: ca.SX) -> np.ndarray:
    return trajectory.values(expressions, trajectory.time)


def _at_limit(row: np.ndarray, low: float, high: float) -> np.ndarray:
    near = REACHED * (high - low)
    return sides(row, low + near, high - near, high - low)


def _order(motion: Optimum, path: str) -> Feature:
    """Which input changes between its limits first, and which then."""
    found = []
    for name, side in _limited(motion, path).items():
        at = np.flatnonzero(side)
        found += [(int(at[k + 1]), name) for k in np.flatnonzero(np.diff(side[at]))[:1]]
    names = [name for _, name in sorted(found)][:2]
    words = f"first {', then '.join(names)} changes between its limits" if names else ""
    return Feature(tuple(names), words)
