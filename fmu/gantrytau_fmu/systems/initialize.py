"""Consistent values at the beginning: every connected input equals the output that drives it.

In initialisation mode outputs are carried to inputs, component after component, until nothing changes. That finds the
answer for systems without algebraic loops in as many rounds as they have components. A loop is solved by Newton's
method on r(u) = T y(u) - u over the real connected inputs u, with columns of dr/du from differences, one input at a
time, and steps that are halved until the largest scaled residual shrinks.
"""

from collections.abc import Sequence

import numpy as np

from gantrytau.border.refusal import InitializationError, SolveError
from gantrytau_fmu.systems.master import Master

AGREEMENT = 1e-10  # relative to the largest of both values, and to one unit near zero
PERTURBATION = 1e-6  # relative; the error of a difference is near that of its rounding, 1e-10
ROUNDS, HALVINGS = 30, 12


def initialize(master: Master) -> None:
    """Carry outputs to inputs until they agree; InitializationError with `.residuals` if they do not."""
    try:
        master.read()
        for _ in range(len(master.parts) + 2):
            if not _carry(master):
                return
        _newton(master)
    except SolveError as error:
        if isinstance(error, InitializationError):
            raise
        raise InitializationError(f"{error} (while the system was initialised)") from error


def _carry(master: Master) -> bool:
    """One round in the order of the sequence; whether anything changed."""
    before = {name: list(values) for name, values in master.values.items()}
    for name in master.sequence:
        if master.known[name]:
            _put(master, name, master.inputs(name, master.grid.begin))
    pairs = [(np.array(master.values[name]), np.array(before[name])) for name in master.parts]
    return any(np.any(abs(new - old) > AGREEMENT * _scale(new, old)) for new, old in pairs)


def _put(master: Master, name: str, inputs: Sequence[float]) -> None:
    """Set the inputs of a component and read what follows."""
    part = master.parts[name]
    part.set(master.known[name], inputs)
    master.values[name] = part.get(master.wanted[name])
    master.check(name, master.grid.begin)


def _newton(master: Master) -> None:
    u = _targets(master)
    for _ in range(ROUNDS):
        residual = _residual(master, u)
        if np.all(abs(residual) <= AGREEMENT * _scale(u, u + residual)):
            _carry(master)
            return
        jacobian = _jacobian(master, u, residual)
        try:
            change = np.linalg.solve(jacobian, -residual)
        except np.linalg.LinAlgError:
            break
        u = _damped(master, u, change, residual)
    raise _unsolved(master, u)


def _damped(master: Master, u: np.ndarray, change: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """The longest of the halved Newton steps that makes the residual smaller; the shortest if none does."""
    scale = _scale(u, u + residual)
    trial = u
    for halving in range(HALVINGS):
        trial = u + change / 2**halving
        if np.max(abs(_residual(master, trial)) / scale) < np.max(abs(residual) / scale):
            break
    return trial


def _targets(master: Master) -> np.ndarray:
    """What drives the inputs of all components, one after the other."""
    begin = master.grid.begin
    return np.array([value for name in master.parts for value in master.inputs(name, begin)])


def _residual(master: Master, u: np.ndarray) -> np.ndarray:
    place = 0
    for name in master.parts:
        count = len(master.known[name])
        if count:
            _put(master, name, u[place : place + count].tolist())
        place += count
    return _targets(master) - u


def _jacobian(master: Master, u: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """dr/du by differences; each input changes the outputs of its own component only."""
    _residual(master, u)
    jacobian = np.empty((u.size, u.size))
    first = 0
    for name in master.parts:
        count = len(master.known[name])
        for column in range(first, first + count):
            moved = u.copy()
            moved[column] += PERTURBATION * max(1.0, abs(u[column]))
            _put(master, name, moved[first : first + count].tolist())
            jacobian[:, column] = (_targets(master) - moved - residual) / (moved[column] - u[column])
        if count:
            _put(master, name, u[first : first + count].tolist())
        first += count
    return jacobian


def _unsolved(master: Master, u: np.ndarray) -> InitializationError:
    names = [f"{name}.{scalar}" for name in master.parts for scalar in master.known[name]]
    residuals = dict(zip(names, map(float, _residual(master, u)), strict=True))
    worst = sorted(residuals, key=lambda name: -abs(residuals[name]))[:6]
    words = ", ".join(f"{name} differs by {residuals[name]:.4g}" for name in worst if residuals[name])
    return InitializationError(
        f"co-simulation: the connected outputs and inputs form an algebraic loop without a solution near the start "
        f"values: {words}; give a start for one of these inputs, or break the loop with a state",
        residuals=residuals,
    )


def _scale(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.maximum(1.0, np.maximum(abs(a), abs(b)))
