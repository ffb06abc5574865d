"""A better mesh from a solution: borders at the switches, which the optimiser may move, and finer where it errs."""

import numpy as np

from gantrytau_optimica.answers.playback.ranges import measured
from gantrytau_optimica.answers.playback.replay import Replayed
from gantrytau_optimica.answers.playback.sweeps import PLACES
from gantrytau_optimica.answers.playback.switches import input_range, sides, switches
from gantrytau_optimica.control.limits import signal_limits
from gantrytau_optimica.transcription.mesh import Mesh
from gantrytau_optimica.transcription.trajectory import Trajectory

ORDER = 5  # of the error that an element adds, with three points
MOST_PARTS = 4
NEAR = 0.02  # of an element: borders that are closer to a switch give way to it
# times the root of the accuracy: jumps of ramps, by the range of an input, that are smoothed away
ROUGH = 1.0
PROVEN = 800  # elements, from which on a mesh is not divided only to prove itself
LEAST = 5e-4  # of the horizon: shorter elements hardly move the objective, and the solver crawls
SAME = 1e-4  # of the horizon: switches that are closer count as one


def better_mesh(
    played: Replayed, accuracy: float, movable: bool, roughness: bool, structure: bool = True
) -> Mesh:
    """The next mesh for `accuracy`, relative to sizes of states and ranges of limits.

    movable: whether borders at jumps of inputs may move; roughness: whether to divide where ramps fit a curved input
    badly; structure: whether switches become borders.
    """
    trajectory = played.trajectory
    borders = trajectory.mesh.borders
    changes = switches(trajectory) if structure else []
    knots = _apart(np.array([s.share for s in changes]))
    parts = _parts(played, accuracy)
    if roughness:
        rough = _rough(trajectory) > ROUGH * np.sqrt(accuracy)
        joined = any("between" in (s.before, s.after) for s in changes)
        parts = np.maximum(parts, np.where(rough | (joined & _at_junctions(trajectory)), 2, 1))
    every = _with_knots(borders, parts, knots)
    same = every.size == borders.size and np.allclose(every, borders, atol=1e-9)
    if same and trajectory.mesh.elements < PROVEN:  # only a finer mesh shows that this one was fine enough
        every = _with_knots(borders, np.where(open_elements(trajectory), 2, 1), knots)
    jumps = _apart(np.array([s.share for s in changes if "between" not in (s.before, s.after)]))
    jumps = np.array([k for k in jumps if np.any(np.abs(knots - k) < 1e-12)]) if movable else jumps[:0]
    return Mesh(every, tuple(int(k) for k in np.searchsorted(every, jumps)))


def at_knots(played: Replayed, accuracy: float, knots: np.ndarray) -> np.ndarray:
    """Borders (n + 1,) with knots among them, and elements divided where they err, or to prove that they do not."""
    trajectory = played.trajectory
    borders = trajectory.mesh.borders
    every = _with_knots(borders, _parts(played, accuracy), knots)
    if every.size == borders.size and np.allclose(every, borders, atol=SAME):
        return _with_knots(borders, np.where(open_elements(trajectory), 2, 1), knots)
    return every


def zoomed(played: Replayed, accuracy: float, places: np.ndarray) -> Mesh:
    """A mesh finer where it errs, and finer still beside places (k,) at which the structure changes."""
    borders = played.trajectory.mesh.borders
    widths = np.diff(borders)
    sides = [np.searchsorted(borders, places + step) - 1 for step in (-SAME, SAME)]  # a border has two
    beside = np.unique(np.clip(np.concatenate(sides), 0, widths.size - 1))
    parts = _parts(played, accuracy)
    parts[beside] = np.where(widths[beside] > LEAST, np.maximum(parts[beside], MOST_PARTS), parts[beside])
    return Mesh(divided(borders, parts))


def _with_knots(borders: np.ndarray, parts: np.ndarray, knots: np.ndarray) -> np.ndarray:
    """Borders with elements divided, and with knots, to which borders close by give way."""
    kept = divided(borders, parts)[1:-1]
    for knot in knots:
        element = int(np.clip(np.searchsorted(borders, knot) - 1, 0, borders.size - 2))
        near = max(LEAST, NEAR * min(np.diff(borders)[max(element - 1, 0) : element + 2]))
        kept = kept[np.abs(kept - knot) > near]
    return np.unique(np.concatenate([[0.0, 1.0], kept, knots]))


def _at_junctions(trajectory: Trajectory) -> np.ndarray:
    """Elements at a limit beside one that is not, or at an end of the horizon: the input may leave it inside, (n,)."""
    free = open_elements(trajectory)
    if not np.any(free) and trajectory.mesh.elements > 2:
        return np.zeros(free.size, bool)
    beside = np.append(free[1:], True) | np.insert(free[:-1], 0, True)
    return ~free & beside & (trajectory.mesh.widths > 4 * LEAST)


def open_elements(trajectory: Trajectory) -> np.ndarray:
    """Elements in which an input is nowhere at a limit: there it may be curved, (n,)."""
    phase = trajectory.phase
    limits = signal_limits(phase, trajectory.problem.name)
    found = np.full(trajectory.mesh.elements, not phase.inputs)
    first = len(phase.states) + len(phase.algebraics)
    for number, signal in enumerate(phase.inputs, first):
        ends = trajectory.w[trajectory.layout.tracks[number].unknowns]
        low, high = limits[signal.name]
        found |= np.any(sides(ends, low, high, input_range(ends, low, high)) == 0, axis=1)
    return found


def _apart(knots: np.ndarray) -> np.ndarray:
    """Switches inside of the horizon, those that are too close to each other as one."""
    knots = np.sort(knots[(knots > SAME) & (knots < 1 - SAME)])
    if knots.size == 0:
        return knots
    groups = np.split(knots, np.flatnonzero(np.diff(knots) > SAME) + 1)
    return np.array([group.mean() for group in groups])


def _parts(played: Replayed, accuracy: float) -> np.ndarray:
    """Into how many parts every element is divided, by its own error and by limits passed between its points."""
    trajectory = played.trajectory
    n = trajectory.mesh.elements
    sizes = np.array([s.nominal for s in trajectory.phase.states])
    times = trajectory.times(trajectory.mesh.borders)
    owner = np.clip(np.searchsorted(times, played.pieces.mean(axis=1)) - 1, 0, n - 1)
    local = np.nan_to_num(np.max(np.abs(played.local) / sizes, axis=1, initial=0.0), nan=1.0)
    error = np.zeros(n)
    np.maximum.at(error, owner, local)
    ends = trajectory.signals(played.pieces[:, 1])[: sizes.size].T
    missed = np.nan_to_num(np.max(np.abs(played.x[:, -1] - ends) / sizes, initial=0.0))
    growth = max(1.0, missed / (np.sum(local) or 1.0))  # of errors, by a plant that is unstable
    wanted = accuracy / np.sqrt(n) / growth
    if missed > accuracy:  # errors of one sign add up: the largest have to fall by what the end is off
        wanted = min(wanted, float(error.max()) * accuracy / missed / 2)
    passed = np.zeros(n)
    np.maximum.at(passed, owner, _passed(played))
    ratio = np.maximum(error / wanted, passed / accuracy)
    parts = np.ceil(np.maximum(ratio, 1.0) ** (1 / (ORDER + 1)))
    parts = np.clip(np.where(ratio > 1, np.maximum(parts, 2), 1), 1, MOST_PARTS).astype(int)
    # what errs may move into a neighbour, once it costs nothing there
    beside = np.maximum(np.append(parts[1:], 1), np.insert(parts[:-1], 0, 1))
    return np.maximum(parts, np.minimum(beside, 2))


def _passed(played: Replayed) -> np.ndarray:
    """By how much limits are passed in every piece, relative to their range."""
    worst = np.zeros(played.times.size)
    for limit, row, size in measured(played.trajectory, played.values):
        amount = np.maximum(limit.lower - row, row - limit.upper) / size
        worst = np.maximum(worst, np.nan_to_num(amount, nan=0.0))
    return worst.reshape(-1, PLACES.size).max(axis=1)


def _rough(trajectory: Trajectory) -> np.ndarray:
    """How much inputs jump at the borders of an element where neither side is at a limit or a switch, by their range."""
    found = np.zeros(trajectory.mesh.elements)
    moving = np.zeros(trajectory.mesh.elements + 1, bool)
    moving[list(trajectory.mesh.moving)] = True
    first = len(trajectory.phase.states) + len(trajectory.phase.algebraics)
    for number, signal in enumerate(trajectory.phase.inputs, first):
        if signal.pieces.kind != "ramps":
            continue
        ends = trajectory.w[trajectory.layout.tracks[number].unknowns]
        jump = np.abs(ends[1:, 0] - ends[:-1, 1]) / (float(np.ptp(ends)) or 1.0)
        jump = np.where(moving[1:-1], 0.0, jump)
        found[1:] = np.maximum(found[1:], jump)
        found[:-1] = np.maximum(found[:-1], jump)
    return found


def divided(borders: np.ndarray, parts: np.ndarray) -> np.ndarray:
    """Borders with every element divided into equal parts."""
    inner = [np.linspace(a, b, k + 1)[:-1] for a, b, k in zip(borders[:-1], borders[1:], parts, strict=True)]
    return np.concatenate([*inner, [1.0]])
