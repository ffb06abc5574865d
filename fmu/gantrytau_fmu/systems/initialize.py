"""Consistent values at the beginning: every connected input equals the output that drives it.

In initialisation mode outputs are carried to inputs, component after component, until nothing changes. That finds the
answer for systems without algebraic loops in as many rounds as they have components. A loop is solved by Newton's
method on r(u) = T y(u) - u over the real connected inputs u, with columns of dr/du from differences, one input at a
time, and steps that are halved until the largest scaled residual shrinks.
"""

from collections.abc import Sequence

import numpy as np

from gantrytau.border.refusal import InitializationError, SolveError
from gantrytau_fmu.systems.component import dotted
from gantrytau_fmu.systems.master import RunningSystem

AGREEMENT = 1e-10  # relative to the largest of both values, and to one unit near zero
PERTURBATION = 1e-6  # relative; the error of a difference is near that of its rounding, 1e-10
ROUNDS, HALVINGS = 30, 12


def initialize(running: RunningSystem) -> None:
    """Carry outputs to inputs until they agree; InitializationError with `.residuals` if they do not."""
    try:
        running.read()
        for _ in range(len(running.parts) + 2):
            if not _carry(running):
                return
        _newton(running)
    except SolveError as error:
        if isinstance(error, InitializationError):
            raise
        raise InitializationError(f"{error} (while the system was initialised)") from error


def _carry(running: RunningSystem) -> bool:
    """One round in the order of the sequence; whether anything changed."""
    before = {name: list(values) for name, values in running.values.items()}
    for name in running.sequence:
        if running.known[name]:
            _put(running, name, running.inputs(name, running.grid.begin))
    pairs = [(np.array(running.values[name]), np.array(before[name])) for name in running.parts]
    return any(np.any(abs(new - old) > AGREEMENT * _scale(new, old)) for new, old in pairs)


def _put(running: RunningSystem, name: str, inputs: Sequence[float]) -> None:
    """Set the inputs of a component and read what follows."""
    part = running.parts[name]
    part.set(running.known[name], inputs)
    running.values[name] = part.get(running.wanted[name])
    running.check(name, running.grid.begin)


def _newton(running: RunningSystem) -> None:
    u = _targets(running)
    for _ in range(ROUNDS):
        residual = _residual(running, u)
        if np.all(abs(residual) <= AGREEMENT * _scale(u, u + residual)):
            _carry(running)
            return
        jacobian = _jacobian(running, u, residual)
        try:
            change = np.linalg.solve(jacobian, -residual)
        except np.linalg.LinAlgError:
            break
        u = _damped(running, u, change, residual)
    raise _unsolved(running, u)


def _damped(running: RunningSystem, u: np.ndarray, change: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """The longest of the halved Newton steps that makes the residual smaller; the shortest if none does."""
    scale = _scale(u, u + residual)
    trial = u
    for halving in range(HALVINGS):
        trial = u + change / 2**halving
        if np.max(abs(_residual(running, trial)) / scale) < np.max(abs(residual) / scale):
            break
    return trial


def _targets(running: RunningSystem) -> np.ndarray:
    """What drives the inputs of all components, one after the other."""
    begin = running.grid.begin
    return np.array([value for name in running.parts for value in running.inputs(name, begin)])


def _residual(running: RunningSystem, u: np.ndarray) -> np.ndarray:
    place = 0
    for name in running.parts:
        count = len(running.known[name])
        if count:
            _put(running, name, u[place : place + count].tolist())
        place += count
    return _targets(running) - u


def _jacobian(running: RunningSystem, u: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """dr/du by differences; each input changes the outputs of its own component only."""
    _residual(running, u)
    jacobian = np.empty((u.size, u.size))
    first = 0
    for name in running.parts:
        count = len(running.known[name])
        for column in range(first, first + count):
            moved = u.copy()
            moved[column] += PERTURBATION * max(1.0, abs(u[column]))
            _put(running, name, moved[first : first + count].tolist())
            jacobian[:, column] = (_targets(running) - moved - residual) / (moved[column] - u[column])
        if count:
            _put(running, name, u[first : first + count].tolist())
        first += count
    return jacobian


def _unsolved(running: RunningSystem, u: np.ndarray) -> InitializationError:
    names = [dotted(name, scalar) for name in running.parts for scalar in running.known[name]]
    residuals = dict(zip(names, map(float, _residual(running, u)), strict=True))
    worst = sorted(residuals, key=lambda name: -abs(residuals[name]))[:6]
    words = ", ".join(f"{name} differs by {residuals[name]:.4g}" for name in worst if residuals[name])
    return InitializationError(
        f"co-simulation: the connected outputs and inputs form an algebraic loop without a solution near the start "
        f"values: {words}; give a start for one of these inputs, or break the loop with a state",
        residuals=residuals,
    )


def _scale(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.maximum(1.0, np.maximum(abs(a), abs(b)))
