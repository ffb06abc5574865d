"""Ends at which loops cannot be closed as the conditions there demand, found before solving.

Of all poses with closed loops, c(x, z) = 0 of states x and of positions z that depend on them, the nearest to what is
demanded, d(x, z), is

    min |d|^2   with   c = 0,

sought from several poses. What is left is the gap: no motion begins or ends there, by whatever way.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau_optimica.control.built import Built
from gantrytau_optimica.control.control_problem import Limit, Phase, Signal
from gantrytau_optimica.control.limits import values_demanded

WORDS = {"initial": "start", "final": "end"}
AT_END = re.compile(r"^(?:initial|final)\((.*)\)$")
MET = 1e-6  # m, rad, or of the value: what is missed by less is rounding
SHOWN = 5e-5  # what is missed by more is told with four digits
DRAWN = 4  # poses beside the guess from which a closed one is sought
BESIDE = 0.3  # m, rad or 1: their deviation from it


@dataclass(frozen=True, eq=False)
class _End:
    """One end of a phase: positions (n,) with their equations, and what is demanded of them."""

    signals: tuple[Signal, ...]
    closed: ca.SX
    missed: ca.SX
    rows: tuple[Limit, ...]


def open_ends(built: Built) -> str:
    """What cannot be reached, in words; "" where nothing is known to be out of reach."""
    problem = built.problem
    if not built.system.loops:
        return ""
    units = {n: v.unit or "" for v in built.read.dae.flat.variables for n in v.elements}
    found: list[str] = []
    for (number, when), demanded in values_demanded(problem).items():
        phase = problem.phases[number]
        end = _end(built, phase, demanded)
        if end is None:
            continue
        misses = _nearest(end, 0.0 if when == "initial" else 1.0, built)
        if misses is not None:
            where = f"{WORDS[when]} of {phase.name}" if phase.name else WORDS[when]
            found.append(_text(where, end, misses, units))
    return "; ".join(found)


def _end(built: Built, phase: Phase, demanded: Sequence[tuple[ca.SX, Limit]]) -> _End | None:
    """The positions of a phase and their equations; None where these do not stand for themselves."""
    numbers = ca.vertcat(*(n.symbol for n in built.problem.free))
    guesses = ca.DM([n.guess for n in built.problem.free])
    positions = [
        (k, a) for k, a in enumerate(phase.algebraics) if a.symbol.name() in built.system.loops or a.is_root
    ]
    allowed = _hashes([*(s.symbol for s in phase.states), *(a.symbol for _, a in positions)])
    rows = [(a, phase.residuals[k]) for k, a in positions]
    while True:  # what depends on other algebraics, as roots of speeds may, is no position
        good = [(a, r) for a, r in rows if _leaves(r) <= allowed]
        if len(good) == len(rows):
            break
        rows = good
        allowed = _hashes([*(s.symbol for s in phase.states), *(a.symbol for a, _ in rows)])
    closed = ca.vertcat(ca.SX(0, 1), *(r for _, r in rows))
    inside = _leaves(closed)
    mine = [(value, row) for value, row in demanded if _leaves(value) and _leaves(value) <= inside]
    signals = tuple(s for s in (*phase.states, *(a for a, _ in rows)) if s.symbol.element_hash() in inside)
    if not mine or not rows or ca.depends_on(closed, numbers):
        return None
    missed = ca.vertcat(*(value - row.lower for value, row in mine))
    return _End(signals, closed, ca.substitute(missed, numbers, guesses), tuple(row for _, row in mine))


def _nearest(end: _End, share: float, built: Built) -> np.ndarray | None:
    """What is missed at the pose nearest to the one demanded, None if nothing is or no pose with closed loops was found."""
    x = ca.vertcat(*(s.symbol for s in end.signals))
    values = ca.Function("values", [x], [end.closed, end.missed])
    guess = _at(end, lambda s: _value(s, share))
    sizes = np.maximum(1.0, np.abs([row.lower for row in end.rows]))
    misses = [np.array(part).ravel() for part in values(guess)]
    if all(np.all(np.abs(part) < MET) for part in misses):
        return None
    solver = ca.nlpsol("nearest", "ipopt", {"x": x, "f": ca.sumsqr(end.missed), "g": end.closed}, OPTIONS)
    bounds = dict(lbx=[s.min for s in end.signals], ubx=[s.max for s in end.signals], lbg=0.0, ubg=0.0)
    start = built.read.dae.start
    told = _at(end, lambda s: start.get(s.symbol.name(), _value(s, 0.0)))
    random = np.random.default_rng(0)
    drawn = [guess + BESIDE * random.standard_normal(guess.size) for _ in range(DRAWN)]
    best: np.ndarray | None = None
    for first in (guess, told, *drawn):
        pose = solver(x0=first, **bounds)["x"]
        if not solver.stats()["success"]:
            continue
        missed = np.array(values(pose)[1]).ravel()
        if np.all(np.abs(missed) < MET * sizes):
            return None
        if best is None or np.linalg.norm(missed) < np.linalg.norm(best):
            best = missed
    return best


OPTIONS = {
    "print_time": False,
    "ipopt": {"print_level": 0, "sb": "yes", "max_cpu_time": 1.0, "max_iter": 200, "tol": 1e-10},
}


def _at(end: _End, value: Callable[[Signal], float]) -> np.ndarray:
    return np.clip([value(s) for s in end.signals], *np.array([(s.min, s.max) for s in end.signals]).T)


def _value(signal: Signal, share: float) -> float:
    return float(np.asarray(signal.guess(np.array([share]))).ravel()[0])


def _text(where: str, end: _End, missed: np.ndarray, units: Mapping[str, str]) -> str:
    """The conditions that contradict the loops, and what they can be instead."""
    names = ", ".join(f"`{row.name}`" for row in end.rows)
    quantities = [row.name.split(" == ")[0] for row in end.rows]
    nearest = ", ".join(
        f"{name} = {row.lower + m:.4f}"
        for name, row, m in zip(quantities, end.rows, missed, strict=True)
        if abs(m) > SHOWN
    )
    lengths = [
        m for name, m in zip(quantities, missed, strict=True) if units.get(AT_END.sub(r"\1", name)) == "m"
    ]
    gap = f", {np.linalg.norm(lengths):.4g} m away" if lengths and nearest else ""
    return (
        f"the {where} is out of reach: no pose was found in which the loops of the mechanism are closed and {names} hold"
        + (f"; the nearest with closed loops{gap}: {nearest}" if nearest else "")
    )


def _leaves(expression: ca.SX) -> set[int]:
    return _hashes(ca.symvar(expression))


def _hashes(symbols: Sequence[ca.SX]) -> set[int]:
    return {s.element_hash() for s in symbols}
