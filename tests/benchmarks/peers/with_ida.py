"""Another way to IDA: scikit-SUNDAE, on the residual and the Jacobian that `simulate` hands to CasADi's IDAS."""

from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.simulation.full_coordinates import Coordinates


class IDA:
    """One second of a model without inputs from its start, dense linear algebra."""

    def __init__(self, coordinates: Coordinates, tolerance: float):
        from sksundae.ida import IDA as Solver  # pyright: ignore[reportMissingImports]

        x, z, _ = coordinates.start(0.0, np.zeros(0))
        y, rate, factor = (
            ca.vertcat(coordinates.x, coordinates.z),
            ca.SX.sym("yp", x.size + z.size),
            ca.SX.sym("cj"),
        )
        residual = ca.vertcat(rate[: x.size] - coordinates.ode, coordinates.algebraic)
        jacobian = ca.jacobian(residual, y) + factor * ca.jacobian(residual, rate)
        at = np.concatenate([x, z])
        rates = ca.Function("rates", [y], [coordinates.ode])(at).full().ravel()
        self._start = at, np.concatenate([rates, np.zeros(z.size)])
        residuals, self._residual = _buffered([y, rate], residual)
        slopes, self._jacobian = _buffered([y, rate, factor], jacobian.T)

        def resfn(t: float, y: np.ndarray, yp: np.ndarray, res: np.ndarray) -> None:
            res[:] = residuals(y, yp)

        def jacfn(
            t: float, y: np.ndarray, yp: np.ndarray, res: np.ndarray, cj: float, JJ: np.ndarray
        ) -> None:
            JJ.ravel()[:] = slopes(y, yp, cj)

        self._solver: Any = Solver(
            resfn,
            jacfn=jacfn,
            algebraic_idx=list(range(x.size, at.size)),
            rtol=tolerance,
            atol=tolerance,
            max_num_steps=100_000,
        )

    def run(self) -> np.ndarray:
        """The unknowns after one second."""
        return self._solver.solve(np.array([0.0, 1.0]), *self._start).y[-1]


def _buffered(arguments: list[ca.SX], result: ca.SX) -> tuple[Callable[..., np.ndarray], object]:
    """A function of arrays and numbers through buffers of CasADi, and what must live as long as it."""
    function = ca.Function("f", arguments, [ca.densify(result)], {"cse": True})
    buffer, call = function.buffer()
    inside = [np.empty(a.numel()) for a in arguments]
    outside = np.empty(result.numel())
    for k, memory in enumerate(inside):
        buffer.set_arg(k, memory.data)
    buffer.set_res(0, outside.data)

    def evaluated(*values: Any) -> np.ndarray:
        for memory, value in zip(inside, values, strict=True):
            memory[:] = value
        call()
        return outside

    return evaluated, (buffer, function)
