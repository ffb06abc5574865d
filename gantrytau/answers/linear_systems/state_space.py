"""A linear system from four matrices, which answers as such and is a component of models as well."""

from collections.abc import Iterator
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.answers.linear_systems.linear_system import LinearSystem
from gantrytau.border.checks import array, number
from gantrytau.language.declarations import Input, Output, Real
from gantrytau.language.events import sampled
from gantrytau.language.model import Model
from gantrytau.language.symbols import der


class StateSpace(LinearSystem, Model):
    """x' = A x + B u, y = C x + D u: `StateSpace(A, B, C, D)`, with a `period` in s from sample to sample.

    A (n, n), B (n, m), C (k, n), D (k, m); numbers do where a size is one, and 0 for a D of zeros. It answers at once
    (`.poles`, `.response(hertz)`, `.simulate(u)`, see `LinearSystem`), and stands in the body of a model as a component with
    the ports `u` and `y`, scalars where there is one of them, else (m,) and (k,): `connect(plant.y, controller.u)`. Units
    of u, x and y are open. x starts at zero, `x=Fixed([...])` says otherwise. A discrete one takes u at t0 + k * period and
    gives y[k] = C x[k] + D u[k] from there on. Raises ModelError for matrices that do not fit together.
    """

    u = Input(lambda self: _sized(self.B.shape[1]), description="input")
    y = Output(lambda self: _sized(self.C.shape[0]), description="output")
    x = Real(lambda self: max(1, self.A.shape[0]), description="state", start=0.0, fixed=True)

    def __init__(
        self, A: Any, B: Any, C: Any, D: Any = 0, *, period: float | None = None, **modifications: Any
    ):
        self.period = None if period is None else number("StateSpace", "period", period, unit="s", above=0)
        self.A, self.B, self.C, self.D = _matrices(A, B, C, D)
        self.states = _names("x", (len(self.A),))
        self.inputs, self.outputs = (
            _names(letter, _sized(count)) for letter, count in (("u", self.B.shape[1]), ("y", len(self.C)))
        )
        self.units = {}
        super().__init__(**modifications)

    @property
    def title(self) -> str:
        """The class, and the period."""
        return "StateSpace" if self.period is None else f"StateSpace, every {self.period:g} s"

    def equations(self) -> Iterator[Any]:
        A, B, C, D = (ca.DM(M) for M in (self.A, self.B, self.C, self.D))
        state, output = A @ self.x + B @ self.u, C @ self.x + D @ self.u
        if self.period is not None:
            yield sampled(self.x, state, period=self.period)
            yield sampled(self.y, output, period=self.period)
            return
        yield der(self.x) == state
        yield self.y == output


def _matrices(A: Any, B: Any, C: Any, D: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """As matrices; a column for B and a row for C may be flat, and 0 stands for a D of zeros.

    ModelError where they do not fit together: n states, m inputs, k outputs.
    """
    A, B, C, D = (array("StateSpace", *pair) for pair in (("A", A), ("B", B), ("C", C), ("D", D)))
    n = A.shape[0] if A.ndim == 2 else 1
    A = A.reshape(1, 1) if A.size == 1 else A
    B = B.reshape(n, -1) if B.ndim < 2 and B.size % n == 0 else np.atleast_2d(B).T if B.ndim < 2 else B
    C = C.reshape(-1, n) if C.ndim < 2 and C.size % n == 0 else np.atleast_2d(C)
    if D.ndim < 2:
        D = np.full((len(C), B.shape[1]), float(D)) if D.size == 1 and not np.any(D) else np.atleast_2d(D)
    k, m = len(C), B.shape[-1]
    shapes = {"A": (A, (n, n)), "B": (B, (n, m)), "C": (C, (k, n)), "D": (D, (k, m))}
    A, B, C, D = (array("StateSpace", name, matrix, shape) for name, (matrix, shape) in shapes.items())
    return A, B, C, D


def _sized(count: int) -> tuple[int, ...]:
    return () if count == 1 else (count,)


def _names(letter: str, shape: tuple[int, ...]) -> tuple[str, ...]:
    return (letter,) if shape == () else tuple(f"{letter}[{k}]" for k in range(shape[0]))
