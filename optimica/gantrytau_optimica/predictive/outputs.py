"""What is measured of a model at a point: y = h(x, z, u), 0 = g(x, z, u), algebraics eliminated."""

from collections.abc import Sequence

import casadi as ca
import numpy as np

from gantrytau import ModelError
from gantrytau.simulation.events.at_places import AtPlaces
from gantrytau_optimica.control.built import Built
from gantrytau_optimica.predictive.stages import SETTLED, TURNS, HorizonStages


class Outputs:
    """Variables of a model by scalar names, with their Jacobians by scaled states.

    added: expressions of signals that are added to them, (ny,).
    """

    def __init__(self, built: Built, stages: HorizonStages, names: Sequence[str], added: ca.SX | None = None):
        self.stages = stages
        y, t, courses = stages.symbols
        out = stages.at_point(built.expressed(names) + (0 if added is None else added))
        both = ca.vertcat(stages.equations[stages.nx :, :], out)
        J = ca.jacobian(both, y)[:, : stages.nx + stages.nz]
        self._point = AtPlaces(ca.Function("outputs", [y, t, courses], [ca.densify(both), ca.densify(J)]))

    def at(
        self, x: np.ndarray, z: np.ndarray, u: np.ndarray, times: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Outputs (n, ny) and their Jacobian (n, ny, nx) at scaled points, and changes (n, nz, 1 + nx) of the algebraics by
        (1, x).
        """
        nx, nz, n = self.stages.nx, self.stages.nz, len(x)
        values, J = self._point(np.concatenate([x, z, u], axis=1), times, self.stages.course_values(times).T)
        J = J.reshape(n, nx + nz, -1).swapaxes(1, 2)
        h, C, change = values[:, nz:], J[:, nz:, :nx], np.zeros((n, nz, 1 + nx))
        if nz:
            right = np.concatenate([values[:, :nz, None], J[:, :nz, :nx]], axis=2)
            change = -np.linalg.solve(J[:, :nz, nx:], right)
            along = J[:, nz:, nx:] @ change
            h, C = h + along[..., 0], C + along[..., 1:]
        return h, C, change

    def settled(self, x: np.ndarray, z: np.ndarray, u: np.ndarray, t: float) -> np.ndarray:
        """The algebraics (nz,) at a point, by Newton's method from a guess; ModelError where there are none."""
        if not self.stages.nz:
            return z
        for _ in range(TURNS):
            change = self.at(x[None], z[None], u[None], np.array([t]))[2][0, :, 0]
            z = z + change
            if not np.isfinite(change).all():
                break
            if np.abs(change).max() < SETTLED:
                return z
        words = f"the equations have no solution near the state at t = {t:g} s"
        raise ModelError(words, place=self.stages.problem.name)
