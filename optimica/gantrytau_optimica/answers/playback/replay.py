"""The equations of a phase integrated anew, with the solution's own inputs: what a robot would do with them.

    dx/ds = h f(t0 + h s, x, z, u(s)),  0 = g(...),  0 <= s <= 1        on every piece between two borders

Inputs are the polynomials of the solution, so a piece is smooth: where 17 places resolve it, sweeps of Picard from the
solution lead to rounding. Elsewhere CVODES or IDAS begins anew on each piece, so that their errors add up.
"""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from gantrytau.describing.record import Record
from gantrytau.kernels import kernel
from gantrytau_optimica.answers.playback.sweeps import INTEGRALS, PLACES, Sweeps, Swept
from gantrytau_optimica.control.built import Built
from gantrytau_optimica.transcription.layout import lagrange, polynomials
from gantrytau_optimica.transcription.trajectory import Trajectory

TOLERANCE = 1e-10
SWEEPS = 20  # of a piece, that are expected


@dataclass(frozen=True, eq=False)
class Replayed(Record):
    """States and algebraics of one phase, pieces one after another.

    pieces (n, 2): begin and end in s; x (n, 17, nx), z (n, 17, nz) at Chebyshev places of each piece; local (n, nx):
    by how much the end of a piece misses the solution if it begins on it; complete: whether the integration came
    to the end.
    """

    trajectory: Trajectory
    pieces: np.ndarray
    x: np.ndarray
    z: np.ndarray
    local: np.ndarray
    complete: bool

    @property
    def away(self) -> float:
        """Its largest deviation from the solution at ends of pieces, by sizes of states, as far as it came."""
        ends = self.x[:, -1][np.all(np.isfinite(self.x[:, -1]), axis=1)]
        wanted = self.trajectory.signals(self.pieces[: len(ends), 1])[: ends.shape[1]].T
        sizes = [s.nominal for s in self.trajectory.phase.states]
        return float(np.max(np.abs(ends - wanted) / sizes, initial=0.0))

    @cached_property
    def times(self) -> np.ndarray:
        """All times in s, (17 n,); borders occur twice, once for each side."""
        return (self.pieces[:, :1] + np.diff(self.pieces, axis=1) * PLACES).ravel()

    @cached_property
    def signals(self) -> np.ndarray:
        """States, algebraics, inputs and known courses (k, 17 n) at all times."""
        phase, count = self.trajectory.phase, len(self.pieces)
        inputs = _course_values(self.trajectory, self.pieces, PLACES)
        total = count * PLACES.size
        rows = [self.x.transpose(2, 0, 1).reshape(len(phase.states), total)]
        rows.append(self.z.transpose(2, 0, 1).reshape(len(phase.algebraics), total))
        rows.append(inputs.reshape(-1, total) if inputs.size else np.zeros((0, total)))
        return np.vstack(rows)

    def values(self, expressions: ca.SX) -> np.ndarray:
        """Expressions of the phase's symbols (m,) at all times: (m, 17 n)."""
        rows = np.array(self.trajectory.function(expressions)(self.times[None, :], self.signals))
        return rows if rows.shape[1] == self.times.size else np.repeat(rows, self.times.size, axis=1)

    def at(self, expressions: ca.SX, times: np.ndarray, after: bool = False) -> np.ndarray:
        """Expressions (m,) at times (k,), (m, k), interpolated between the places of their pieces.

        A border belongs to the piece before it, or the one after it.
        """
        beside = 1e-9 * float(np.min(np.diff(self.pieces))) if after else -1e-12
        piece = np.clip(np.searchsorted(self.pieces[:, 1], times + beside), 0, len(self.pieces) - 1)
        begin, end = self.pieces[piece].T
        place = np.clip((times - begin) / (end - begin), 0.0, 1.0)
        weights = lagrange(np.tile(PLACES, (times.size, 1)), place)
        rows = self.values(expressions).reshape(expressions.numel(), -1, PLACES.size)
        return np.einsum("mkp,kp->mk", rows[:, piece], weights)

    def integral(self, expressions: ca.SX) -> np.ndarray:
        """Integrals of expressions over the phase, (m,), by Clenshaw's and Curtis' weights."""
        rows = self.values(expressions).reshape(expressions.numel(), -1, PLACES.size)
        return np.einsum("mpk,k,p->m", rows, INTEGRALS[-1], np.diff(self.pieces, axis=1)[:, 0])


def replay(built: Built, trajectory: Trajectory) -> Replayed:
    """Integrate a phase with the inputs of the solution, from the solution's start."""
    phase = trajectory.phase
    pieces, owner = _pieces(trajectory)
    if not phase.states:
        return _unmoved(trajectory, pieces)
    courses = _course_values(trajectory, pieces, _nodes(trajectory))  # (k, n, m)
    numbers = np.tile(trajectory.numbers, (len(pieces), 1))
    p = np.hstack(
        [courses.transpose(1, 0, 2).reshape(len(pieces), -1), pieces[:, :1], np.diff(pieces), numbers]
    )
    starts = trajectory.signals(pieces[:, 0])[: len(phase.states)].T
    first = np.array([trajectory.w[trajectory.layout.starts[e]] for e in owner])
    on_border = np.concatenate([[True], owner[1:] != owner[:-1]])
    starts = np.where(on_border[:, None], first, starts)
    after = np.vstack([starts[1:], trajectory.w[trajectory.layout.starts[-1]][None, :]])
    system = _system(built, trajectory, len(pieces))
    own = system.along(trajectory, pieces, owner, starts, p)
    x, kept = np.full_like(own.x, np.nan), np.full_like(own.kept, np.nan)
    local = np.full((len(pieces), len(phase.states)), np.nan)
    guesses = _algebraics(trajectory, pieces)[:, system.sweeps.kept]
    state, complete = starts[0], True
    for k in range(len(pieces)):
        try:
            x[k], kept[k] = system.moved(state, own, k, guesses[k], p[k])
            end = own.x[k, -1]
            if not own.settled[k]:
                end = system.integrated(starts[k], guesses[k], p[k], bool(own.rough[k]))[0][-1]
        except RuntimeError:  # the integrator gave up: what follows is unknown
            x[k:], kept[k:], complete = np.nan, np.nan, False
            break
        local[k], state = end - after[k], x[k][-1]
    z = system.sweeps.values(system.sweeps.algebraics, x, kept, p)
    z[np.isnan(x[:, -1]).any(axis=1)] = np.nan
    return Replayed(trajectory, pieces, x, z, local, complete)


def _unmoved(trajectory: Trajectory, pieces: np.ndarray) -> Replayed:
    """A phase without states: its algebraics are those of the solution, there is nothing to integrate."""
    nz = len(trajectory.phase.algebraics)
    times = (pieces[:, :1] + np.diff(pieces, axis=1) * PLACES).ravel()
    z = trajectory.signals(times)[:nz].T.reshape(len(pieces), PLACES.size, nz)
    none = np.zeros((len(pieces), PLACES.size, 0))
    return Replayed(trajectory, pieces, none, z, np.zeros((len(pieces), 0)), True)


def _pieces(trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """Begin and end of all pieces in s, and the element of each: elements, divided where a known course has a kink."""
    borders = trajectory.times(trajectory.mesh.borders)
    kinks = [course.kinks for course in trajectory.phase.courses]
    inner = np.concatenate([np.zeros(0), *kinks])
    inner = inner[(inner > borders[0]) & (inner < borders[-1])]
    every = np.unique(np.concatenate([borders, inner]))
    keep = np.concatenate([[True], np.diff(every) > 1e-9 * (borders[-1] - borders[0])])
    every = every[keep]
    every[-1] = borders[-1]
    pieces = np.column_stack([every[:-1], every[1:]])
    owner = np.clip(np.searchsorted(borders, pieces.mean(axis=1)) - 1, 0, borders.size - 2)
    return pieces, owner


def _nodes(trajectory: Trajectory) -> np.ndarray:
    """Places in a piece through which inputs and courses are polynomials."""
    nx, nz = len(trajectory.phase.states), len(trajectory.phase.algebraics)
    count = max([2, *(track.nodes.shape[1] for track in trajectory.layout.tracks[nx + nz :])])
    return (np.arange(count) + 0.5) / count


def _course_values(trajectory: Trajectory, pieces: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Inputs and known courses (k, n, m) at places of all pieces, each from its own side of a border."""
    middle = pieces.mean(axis=1, keepdims=True)
    span = np.diff(pieces, axis=1)
    times = pieces[:, :1] + span * places
    borders = trajectory.times(trajectory.mesh.borders)
    element = np.clip(np.searchsorted(borders, middle[:, 0]) - 1, 0, borders.size - 2)
    inside = (times - borders[element][:, None]) / np.diff(borders)[element][:, None]
    element = np.repeat(element, places.size)
    inputs = range(
        len(trajectory.phase.states) + len(trajectory.phase.algebraics), len(trajectory.layout.tracks)
    )
    rows = [trajectory.layout.tracks[i].values(trajectory.w, element, inside.ravel()) for i in inputs]
    shrunk = (middle + (times - middle) * (1 - 1e-9)).ravel()  # keeps to its own side of a jump
    rows += [course.value(shrunk) for course in trajectory.phase.courses]
    return np.array(rows).reshape(-1, len(pieces), places.size)


def _algebraics(trajectory: Trajectory, pieces: np.ndarray) -> np.ndarray:
    """Algebraics of the solution just after the begin of each piece, (n, nz)."""
    nx, nz = len(trajectory.phase.states), len(trajectory.phase.algebraics)
    times = pieces[:, 0] + 1e-9 * (pieces[:, 1] - pieces[:, 0])
    return trajectory.signals(times)[nx : nx + nz].T


@dataclass(frozen=True, eq=False)
class _System:
    """The equations over a piece, in closed form but for algebraics that are kept; dae: for an integrator."""

    sweeps: Sweeps
    dae: dict[str, ca.SX]

    @cached_property
    def integrator(self) -> ca.Function:
        """CVODES or IDAS, made where sweeps do not do."""
        options = {"reltol": TOLERANCE, "abstol": TOLERANCE, "max_num_steps": 1000}
        options |= {"show_eval_warnings": False, "disable_internal_warnings": True}
        method = "idas" if self.sweeps.kept.size else "cvodes"
        return ca.integrator("replay", method, self.dae, 0.0, PLACES.tolist(), options)

    def along(
        self, trajectory: Trajectory, pieces: np.ndarray, owner: np.ndarray, starts: np.ndarray, p: np.ndarray
    ) -> Swept:
        """All pieces from the solution, each from its own start."""
        nx, borders = starts.shape[1], trajectory.times(trajectory.mesh.borders)
        times = pieces[:, :1] + np.diff(pieces, axis=1) * PLACES
        inside = (times - borders[owner][:, None]) / np.diff(borders)[owner][:, None]
        found = trajectory.at(np.repeat(owner, PLACES.size), inside.ravel(), times.ravel())
        found = found.T.reshape(*times.shape, -1)
        x = found[..., :nx] + (starts - found[:, 0, :nx])[:, None]
        return self.sweeps.from_guess(x, found[..., nx + self.sweeps.kept], p)

    def moved(self, state: np.ndarray, own: Swept, k: int, guess: np.ndarray, p: np.ndarray):
        """States and kept algebraics of piece k from a state, near its `own` motion; RuntimeError where it gets stuck."""
        if own.settled[k]:
            beside = own.x[k] + (state - own.x[k, 0])
            found = self.sweeps.swept(beside[None], own.kept[k : k + 1], own.inverse[k : k + 1], p[None])
            if found.settled[0]:
                return found.x[0], found.kept[0]
        return self.integrated(state, guess, p, bool(own.rough[k]))

    def integrated(self, state: np.ndarray, guess: np.ndarray, p: np.ndarray, rough: bool):
        """The same by an integrator, and by sweeps from its answer, unless the piece is too rough for them."""
        sizes = self.sweeps.sizes
        found = self.integrator(x0=state / sizes, z0=guess, p=p)
        x = np.array(found["xf"]).reshape(state.size, PLACES.size).T * sizes
        if not np.all(np.isfinite(x)):
            raise RuntimeError("not finite")
        kept = np.array(found["zf"]).reshape(guess.size, PLACES.size).T
        swept = None if rough else self.sweeps.from_guess(x[None], kept[None], p[None])
        return (swept.x[0], swept.kept[0]) if swept is not None and swept.settled[0] else (x, kept)


def _system(built: Built, trajectory: Trajectory, pieces: int) -> _System:
    phase, problem = trajectory.phase, trajectory.problem
    every = ca.vertcat(ca.SX(0, 1), *(s.symbol for s in phase.algebraics))
    kept = [i for i, a in enumerate(phase.algebraics) if a.name not in built.closed]
    parts = [phase.ode, phase.residuals, ca.jacobian(phase.residuals, every), every]
    parts = built.in_closed_form(phase, [ca.densify(one) for one in (parts if kept else [phase.ode, every])])
    place, begin, span = ca.SX.sym("place"), ca.SX.sym("begin"), ca.SX.sym("span")
    nodes = _nodes(trajectory)
    inputs = [*(s.symbol for s in phase.inputs), *(c.symbol for c in phase.courses)]
    values = ca.SX.sym("values", nodes.size * len(inputs))
    basis = polynomials(nodes, place)
    courses = [ca.dot(basis, values[nodes.size * i : nodes.size * (i + 1)]) for i in range(len(inputs))]
    old, new = ca.vertcat(problem.time, *inputs), ca.vertcat(begin + place * span, *courses)
    ode, *residuals, algebraics = ca.substitute(parts, [old], [new])
    x = ca.vertcat(ca.SX(0, 1), *(s.symbol for s in phase.states))
    z, p = (
        ca.vertcat(ca.SX(0, 1), *(every[i] for i in kept)),
        ca.vertcat(values, begin, span, problem.numbers),
    )
    rates = ode * span
    calls = SWEEPS * PLACES.size * pieces

    def function(name: str, result: ca.SX) -> ca.Function:
        made = ca.Function(name, [place, x, z, p], [ca.densify(result)], {"cse": True})
        return kernel(made, calls) if trajectory.layout.scheme.compiled else made

    sizes = np.array([s.nominal for s in phase.states])
    scaled, none = ca.SX.sym("scaled", x.numel()), [ca.SX(0, 1), ca.SX(0, 0)]
    residual, matrix = residuals or none
    results = dict(rates=rates, residuals=residual, matrix=matrix, algebraics=algebraics)
    sweeps = Sweeps(
        **{name: function(name, one) for name, one in results.items()}, kept=np.array(kept, int), sizes=sizes
    )
    at_kept = residual[kept] if kept else residual
    ode, at_kept = ca.substitute([rates / sizes, at_kept], [x], [scaled * sizes])
    dae = {"t": place, "x": scaled, "p": p, "ode": ca.densify(ode)}
    dae |= {"z": z, "alg": ca.densify(at_kept)} if kept else {}
    return _System(sweeps, dae)
