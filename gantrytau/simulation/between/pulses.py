"""Pulses: functions of time that rest and then change, which an integrator would step over."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau.language.piecewise import switched, with_modes
from gantrytau.language.symbols import time
from gantrytau.simulation.full_coordinates import Coordinates

DENSE = 20_000  # steps of the run in which functions of time are looked at
COARSE = 500  # parts of the run, of each of which is asked whether they rest
BESIDE = 0.37  # of a value, and beside it: where a factor of a function of time does not vanish
AT_REST = 1e-6  # of all its changes: what a function may change in a part in which it rests
RESTING = 4  # parts in a row in which a function rests, so that an integrator forgets it
MOST = 2_000_000  # steps in which it is looked at for the sake of a shorter longest step


def functions_of_time(coordinates: Coordinates) -> ca.SX:
    """Functions of time alone: known symbols, and equations that name the time, at the start and beside it."""
    dae, steady = coordinates.dae, coordinates.dae.table.values
    timed = [k for k, own in dae.indexed.incidence.items() if any(leaf.root == time.name() for leaf in own)]
    rows = ca.vertcat(ca.SX(0, 1), *(dae.indexed.residuals[key] for key in timed))
    leaves = [leaf for leaf in ca.symvar(rows) if leaf.name() != time.name()]
    found = ca.vertcat(ca.SX(0, 1), *coordinates.known.values())
    for beside in (0.0, BESIDE) if timed else ():
        starts = {leaf.name(): dae.start.get(leaf.name(), 0.0) * (1 + beside) + beside for leaf in leaves}
        values = [steady.get(leaf.name(), starts[leaf.name()]) for leaf in leaves]
        found = ca.vertcat(found, ca.substitute(rows, ca.vertcat(ca.SX(0, 1), *leaves), ca.SX(ca.DM(values))))
    inputs = ca.vertcat(coordinates.w, coordinates.t0)
    return ca.substitute(found, inputs, 0 * inputs)


@dataclass(frozen=True)
class Pulses:
    """Spans of time, (n, 2) in s, within which no step must be longer than `step`, s."""

    spans: np.ndarray
    step: float

    def within(self, t: float) -> bool:
        """Whether a time lies in one of them."""
        return bool(np.any((self.spans[:, 0] <= t) & (t < self.spans[:, 1])))


def pulses(functions: ca.SX, begin: float, end: float, longest: float | None = None) -> Pulses:
    """The pulses of functions of time between begin and end, s, as far as 20,000 points show them.

    longest: the longest step allowed anywhere, s, within which nothing is taken to happen.
    """
    nothing = Pulses(np.zeros((0, 2)), np.inf)
    moving = [e for e in functions.elements() if ca.depends_on(e, time)]
    if not moving:
        return nothing
    fine = DENSE // COARSE
    if longest is not None:
        fine = max(fine, min(int(np.ceil((end - begin) / longest / COARSE)), MOST // COARSE))
    t = np.linspace(begin, end, fine * COARSE + 1)
    values = _without_jumps(ca.vertcat(*moving), t)
    whole = np.fmax.reduce(values, axis=1) - np.fmin.reduce(values, axis=1)  # passes over what is no number
    parts = np.stack([values[:, k : k + fine * COARSE : fine] for k in range(fine)] + [values[:, fine::fine]])
    changes = np.fmax.reduce(parts, axis=0) - np.fmin.reduce(parts, axis=0)  # (functions, COARSE)
    rests = changes <= AT_REST * whole[:, None]
    long = np.array([np.convolve(r, np.ones(RESTING), "valid").max() >= RESTING for r in rests])
    some = long & (whole > 0)
    if not some.any():
        return nothing
    active = np.any(~rests[some], axis=0)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], active, [False]]).astype(int)))
    spans = begin + (end - begin) / COARSE * edges.reshape(-1, 2)
    steps = np.abs(np.diff(values[some], axis=1)).reshape(int(some.sum()), COARSE, fine)
    busy = np.mean(steps > AT_REST * whole[some][:, None, None], axis=2)  # share of an active part
    narrow = np.any((busy > 0) & (busy < 1 / 2))
    return Pulses(spans, (end - begin) / COARSE / (fine / 2 if narrow else 4))


def _without_jumps(functions: ca.SX, t: np.ndarray) -> np.ndarray:
    """Functions of time at times, (functions, times), less their jumps, at which the integrator starts anew."""
    found = switched((functions,), {time.name()})
    modes = ca.vertcat(ca.SX(0, 1), *(switch.mode for switch in found.switches))
    (there,) = with_modes(found, (modes,))
    held = np.array(ca.Function("modes", [time], [there]).map(t.size)(t[None]))
    pieces = ca.Function("pieces", [time, modes], list(found.expressions)).map(t.size - 1)
    before, behind = (np.array(pieces(at[None], held[:, :-1])) for at in (t[:-1], t[1:]))
    return np.cumsum(np.hstack([before[:, :1], behind - before]), axis=1)
