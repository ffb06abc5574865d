"""The equations of a phase integrated anew, with the solution's own inputs: what a robot would do with them.

    dx/ds = h f(t0 + h s, x, z, u(s)),  0 = g(...),  0 <= s <= 1        on every piece between two borders

Inputs are the polynomials of the solution, so a piece is smooth. CVODES or IDAS begins anew on each, so that their errors
add up over pieces, and an unstable plant makes them grow: so what 17 places resolve is polished there by sweeps of Picard,

    x(s) <- x(0) + h int_0^s f(x) ds        whose errors fall by a factor of h |df/dx|, to rounding
"""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from gantrytau.describing.record import Record
from gantrytau_optimica.control.built import Built
from gantrytau_optimica.transcription.layout import lagrange, polynomials
from gantrytau_optimica.transcription.trajectory import Trajectory

AGREED = 1e-6  # of its size: by how much a first sweep may change a state
RESOLVED = 1e-12  # of its size: what the highest polynomials have of the rate of a state
TOLERANCE = 1e-10
PLACES = 0.5 - 0.5 * np.cos(
    np.pi * np.arange(17) / 16
)  # Chebyshev's extremes: interpolation between them converges


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


def _partial_integrals(places: np.ndarray) -> np.ndarray:
    """Weights (n, n) of the integrals from 0 to each place, exact for polynomials through the places."""
    primitives = np.polynomial.legendre.legint(np.eye(places.size), lbnd=-1, axis=0)
    return (np.polynomial.legendre.legval(2 * places - 1, primitives).T / 2) @ _transform(places)


def _transform(places: np.ndarray) -> np.ndarray:
    """From values at places to shares of the polynomials of Legendre, (n, n)."""
    return np.linalg.inv(np.polynomial.legendre.legvander(2 * places - 1, places.size - 1))


INTEGRALS, HIGHEST = _partial_integrals(PLACES), _transform(PLACES)[-2:]


def replay(built: Built, trajectory: Trajectory) -> Replayed:
    """Integrate a phase with the inputs of the solution, from the solution's start."""
    phase = trajectory.phase
    pieces, owner = _pieces(trajectory)
    if not phase.states:
        return _unmoved(trajectory, pieces)
    system = _system(built, trajectory)
    nodes = _nodes(trajectory)
    courses = _course_values(trajectory, pieces, nodes)  # (k, n, m)
    numbers = trajectory.numbers
    sizes = np.array([s.nominal for s in phase.states])
    starts = trajectory.signals(pieces[:, 0])[: len(phase.states)].T
    first = np.array([trajectory.w[trajectory.layout.starts[e]] for e in owner])
    on_border = np.concatenate([[True], owner[1:] != owner[:-1]])
    starts = np.where(on_border[:, None], first, starts)
    after = np.vstack([starts[1:], trajectory.w[trajectory.layout.starts[-1]][None, :]])
    guesses = _algebraics(trajectory, pieces)
    x = np.zeros((len(pieces), PLACES.size, len(phase.states)))
    z = np.zeros((len(pieces), PLACES.size, len(phase.algebraics)))
    local = np.full((len(pieces), len(phase.states)), np.nan)
    state, complete = starts[0], True
    for k, (begin, end) in enumerate(pieces):
        p = np.concatenate([courses[:, k].ravel(), [begin, end - begin], numbers])
        try:
            x[k], z[k] = system.run(state, guesses[k], p, sizes)
            local[k] = system.run(starts[k], guesses[k], p, sizes)[0][-1] - after[k]
        except RuntimeError:  # the integrator gave up: what follows is unknown
            x[k:], z[k:], complete = np.nan, np.nan, False
            break
        state = x[k][-1]
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
    """An integrator over a piece, and what it leaves out."""

    integrator: ca.Function
    kept: np.ndarray  # numbers of the algebraics that the integrator solves for
    equations: (
        ca.Function
    )  # (place, x, kept z, p) -> all algebraics, rates by the place, residuals, their Jacobian by z

    def run(self, state: np.ndarray, guess: np.ndarray, p: np.ndarray, sizes: np.ndarray):
        """States (17, nx) and algebraics (17, nz) at Chebyshev places. Raises RuntimeError where it gets stuck."""
        found = self.integrator(x0=state / sizes, z0=guess[self.kept], p=p)
        x = np.array(found["xf"]).reshape(state.size, PLACES.size) * sizes[:, None]
        if not np.all(np.isfinite(x)):
            raise RuntimeError("not finite")
        kept = np.array(found["zf"]).reshape(self.kept.size, PLACES.size)
        x, kept = self._polished(x, kept, p, sizes[:, None])
        return x.T, self._values(x, kept, p)[0].T

    def _values(self, x: np.ndarray, kept: np.ndarray, p: np.ndarray) -> list[np.ndarray]:
        return [np.array(one) for one in self.equations(PLACES[None, :], x, kept, p)]

    def _polished(self, x: np.ndarray, kept: np.ndarray, p: np.ndarray, sizes: np.ndarray):
        """States and algebraics after sweeps that change states ever less, each with a step of Newton's method for the
        algebraics; as they were where the places do not resolve the rates.
        """
        begun, last = (x, kept), AGREED
        while True:
            if kept.size:
                _, _, residuals, jacobian = self._values(x, kept, p)
                matrices = jacobian.reshape(kept.shape[0], PLACES.size, kept.shape[0]).swapaxes(0, 1)
                try:
                    kept = kept - np.linalg.solve(matrices, residuals.T[..., None])[..., 0].T
                except np.linalg.LinAlgError:  # singular at one of the places
                    return begun
            rates = self._values(x, kept, p)[1]
            swept = x[:, :1] + rates @ INTEGRALS.T
            change = float(np.max(np.abs(swept - x) / sizes))
            if not change < last / 2:
                resolved = np.max(np.abs(rates @ HIGHEST.T) / sizes) < RESOLVED
                return (x, kept) if resolved else begun
            x, last = swept, change


def _system(built: Built, trajectory: Trajectory) -> _System:
    phase, problem = trajectory.phase, trajectory.problem
    symbols = [s.symbol for s in phase.algebraics]
    kept = [i for i, a in enumerate(phase.algebraics) if a.name not in built.closed]
    everything = [phase.ode, phase.residuals[kept], ca.vertcat(ca.SX(0, 1), *symbols)]
    everything = built.in_closed_form(phase, [ca.densify(one) for one in everything])
    place, begin, span = ca.SX.sym("place"), ca.SX.sym("begin"), ca.SX.sym("span")
    nodes = _nodes(trajectory)
    inputs = [*(s.symbol for s in phase.inputs), *(c.symbol for c in phase.courses)]
    values = ca.SX.sym("values", nodes.size * len(inputs))
    basis = polynomials(nodes, place)
    courses = [ca.dot(basis, values[nodes.size * i : nodes.size * (i + 1)]) for i in range(len(inputs))]
    old, new = ca.vertcat(problem.time, *inputs), ca.vertcat(begin + place * span, *courses)
    ode, residuals, algebraics = ca.substitute(everything, [old], [new])
    nominal = ca.DM([s.nominal for s in phase.states])
    x = ca.vertcat(ca.SX(0, 1), *(s.symbol for s in phase.states))
    z = ca.vertcat(ca.SX(0, 1), *(symbols[i] for i in kept))
    p = ca.vertcat(values, begin, span, problem.numbers)
    scaled = ca.SX.sym("scaled", x.numel())
    rates, jacobian = ode * span, ca.jacobian(residuals, z)
    equations = [ca.densify(one) for one in (algebraics, rates, residuals, jacobian)]
    ode, residuals = ca.substitute([rates / nominal, residuals], [x], [scaled * nominal])
    dae = {"t": place, "x": scaled, "z": z, "p": p, "ode": ca.densify(ode), "alg": ca.densify(residuals)}
    options = {"reltol": TOLERANCE, "abstol": TOLERANCE, "max_num_steps": 1000}
    options |= {"show_eval_warnings": False, "disable_internal_warnings": True}
    if not kept:
        del dae["z"], dae["alg"]
    method = "idas" if kept else "cvodes"
    integrator = ca.integrator("replay", method, dae, 0.0, PLACES.tolist(), options)
    return _System(integrator, np.array(kept, int), ca.Function("equations", [place, x, z, p], equations))
