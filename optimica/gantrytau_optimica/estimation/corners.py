"""Where the motion of an experiment is not smooth, known beforehand: corners of inputs, and what switches by time."""

import casadi as ca
import numpy as np

from gantrytau.language.piecewise import Turn, switched
from gantrytau_optimica.control.control_problem import ControlProblem, Phase
from gantrytau_optimica.transcription.mesh import Mesh, with_borders

BENT = 1e-9  # of the range of an input: a change of its slope, times the distance of samples, at a corner
LOOKED = 4000  # places of a horizon at which switches that are no plain times are looked for
BISECTIONS = 60
SAMPLED = 100_000  # places of a horizon at which equations are looked at that depend on time
UNSEEN = 0.01  # of all that they change over time, by its integral: what points of one element may miss
CUTS, MOST_CUT = 16, 400  # how often elements are cut for it, and how many may come of it
BEFORE = 1e-12  # of the horizon: a border stands that much before a switch, as the last point of an element is on it


def corners(problem: ControlProblem, phase: Phase) -> np.ndarray:
    """Shares of the horizon, inside of it, at which known inputs jump or bend, or the equations switch by time."""
    start, final = float(phase.start_time), float(phase.final_time)
    times = np.concatenate(
        [(one - start) / (final - start) for one in (_bends(phase), _switches(problem, phase))]
    )
    return np.unique(times[(times > 0) & (times < 1)])


def with_corners(mesh: Mesh, problem: ControlProblem, phase: Phase, most: int) -> Mesh:
    """The mesh with borders at all corners, if these are not more than `most`, and around what its points would miss."""
    shares = corners(problem, phase)
    return _seeing(with_borders(mesh, shares) if 0 < shares.size <= most else mesh, problem, phase)


def _bends(phase: Phase) -> np.ndarray:
    """Times in s at which inputs that are known by samples jump or bend."""
    found = [np.zeros(0)]
    for course in phase.courses:
        kinks = course.kinks
        if not kinks.size:
            continue
        gaps = np.diff(kinks) if kinks.size > 1 else np.ones(1)
        step = np.minimum(np.append(gaps[0], gaps), np.append(gaps, gaps[-1])) / 2
        before, here, after = (course.value(kinks + shift) for shift in (-step, 0.0, step))
        bends = np.abs(after - 2 * here + before)
        found.append(kinks[bends > BENT * np.max(np.abs([before, here, after]))])
    return np.concatenate(found)


def _switches(problem: ControlProblem, phase: Phase) -> np.ndarray:
    """Times in s at which a condition on time alone changes, in inputs that are functions of time or in the model."""
    start, final = float(phase.start_time), float(phase.final_time)
    grid = np.linspace(start, final, LOOKED)
    equations = ca.vertcat(phase.ode, phase.residuals)
    found, modes, values = [np.zeros(0)], [], []
    for turn in switched([equations], [problem.time.name()]).switches:
        margin = ca.substitute(turn.margin, ca.vertcat(ca.SX(0, 1), *modes), ca.vertcat(ca.SX(0, 1), *values))
        if any(leaf.name() != problem.time.name() for leaf in ca.symvar(margin)):
            continue  # of states as well: they are not known beforehand
        plain = Turn(turn.mode, margin, turn.closed, turn.counts)
        modes.append(turn.mode)
        values.append(plain.value)
        slope = ca.jacobian(margin, problem.time)
        if slope.is_constant() and not turn.counts:
            root = ca.Function("root", [problem.time], [problem.time - margin / slope])
            found.append(np.array([float(root(start))]) if float(slope) else np.zeros(0))
        else:
            found.append(_changes(ca.Function("mode", [problem.time], [plain.value]), grid))
    return np.concatenate(found) - BEFORE * (final - start)


def _changes(mode: ca.Function, grid: np.ndarray) -> np.ndarray:
    """Times between those of the grid at which a mode changes."""

    def at(times: np.ndarray) -> np.ndarray:
        return np.array(mode(times[None, :])).ravel()

    values = at(grid)
    rows = np.flatnonzero(values[1:] != values[:-1])
    left, right, before = grid[rows], grid[rows + 1], values[rows]
    for _ in range(BISECTIONS):
        middle = (left + right) / 2
        same = at(middle) == before if middle.size else np.zeros(0, bool)
        left, right = np.where(same, middle, left), np.where(same, right, middle)
    return right


def _seeing(mesh: Mesh, problem: ControlProblem, phase: Phase) -> Mesh:
    """The mesh cut where functions of time in the equations are not seen by the points of its elements, as narrow pulses."""
    courses = [c.symbol for c in phase.courses]
    equations = ca.vertcat(phase.ode, phase.residuals)
    of_time = np.flatnonzero(ca.which_depends(equations, problem.time, 1, True)) if equations.numel() else []
    if not len(of_time):
        return mesh
    equations = equations[[int(k) for k in of_time]]
    known = [s.symbol for s in phase.signals] + courses + [n.symbol for n in problem.free]
    values = [float(s.guess(np.zeros(1))[0]) for s in phase.signals] + [0.0] * len(courses)
    values += [n.guess for n in problem.free]
    moving = ca.Function("moving", [problem.time, ca.vertcat(*known)], [equations])
    start, final = float(phase.start_time), float(phase.final_time)
    share = (np.arange(SAMPLED) + 0.5) / SAMPLED
    found = np.array(moving(ca.DM(start + (final - start) * share).T, ca.DM(values)))
    rows = found[np.all(np.isfinite(found), axis=1)]
    rows = rows[np.ptp(rows, axis=1) > 0]
    if not rows.size:
        return mesh
    change = rows - np.median(rows, axis=1)[:, None]
    change /= np.mean(np.abs(change), axis=1)[:, None]
    for _ in range(CUTS):
        missed = _missed(mesh, share, change)
        if not np.any(missed > UNSEEN) or mesh.elements + np.sum(missed > UNSEEN) > MOST_CUT:
            return mesh
        middles = (mesh.borders[:-1] + mesh.borders[1:]) / 2
        mesh = Mesh(np.sort(np.append(mesh.borders, middles[missed > UNSEEN])), (), mesh.shortest)
    return mesh


def _missed(mesh: Mesh, share: np.ndarray, change: np.ndarray) -> np.ndarray:
    """Integral of what straight lines from end to end of each element miss of rows (m, N) at shares (N,), (elements,)."""
    element, _ = mesh.locate(share)
    ends = np.array([np.interp(mesh.borders, share, row) for row in change])
    lines = np.array([np.interp(share, mesh.borders, row) for row in ends])
    missed = np.abs(change - lines) / share.size
    return np.max([np.bincount(element, row, mesh.elements) for row in missed], axis=0)
