"""Motion and forces of MJCF by MuJoCo, its soft constraints replaced by exact ones."""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from scipy.integrate import solve_ivp

JOINT = mujoco.mjtObj.mjOBJ_JOINT  # pyright: ignore[reportAttributeAccessIssue]


class Reference:
    """A model of MuJoCo without contacts."""

    def __init__(self, file: Path):
        lib: Any = mujoco
        self.lib = lib
        self.model = lib.MjModel.from_xml_path(str(file))
        self.data = lib.MjData(self.model)
        self.model.opt.disableflags |= lib.mjtDisableBit.mjDSBL_CONTACT | lib.mjtDisableBit.mjDSBL_LIMIT
        self.model.opt.jacobian = lib.mjtJacobian.mjJAC_DENSE

    @property
    def joints(self) -> list[str]:
        return [self.lib.mj_id2name(self.model, JOINT, k) for k in range(self.model.njnt)]

    def forces(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Forces of the joints of a tree at coordinates, speeds and accelerations."""
        self.data.qpos[:], self.data.qvel[:], self.data.qacc[:] = q, v, a
        self.lib.mj_inverse(self.model, self.data)
        return self.data.qfrc_inverse.copy()

    def jacobian(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Jacobian of the equality constraints."""
        self.data.qpos[:], self.data.qvel[:] = q, v
        self.lib.mj_forward(self.model, self.data)
        count = self.data.ne
        return self.data.efc_J.reshape(-1, self.model.nv)[:count].copy()

    def accelerations(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Newton's law with exact constraints: M a + J' f = passive - bias, J a = -J' v."""
        h, nv = 1e-6, self.model.nv
        J = self.jacobian(q, v)
        M = np.zeros((nv, nv))
        self.lib.mj_fullM(self.model, self.data, M)
        right = self.data.qfrc_passive - self.data.qfrc_bias
        turning = (self.jacobian(q + h * v, v) - self.jacobian(q - h * v, v)) @ v / (2 * h)
        system = np.block([[M, J.T], [J, np.zeros((len(J), len(J)))]])
        return np.linalg.lstsq(system, np.concatenate([right, -turning]), rcond=1e-10)[0][:nv]

    def violation(self, q: np.ndarray) -> float:
        """By how much the equality constraints are violated at most, in m and rad."""
        self.jacobian(q, 0 * q)
        return float(np.abs(self.data.efc_pos[: self.data.ne]).max())

    def motion(self, stop: float, q: np.ndarray) -> np.ndarray:
        """Coordinates at the end of a motion from rest at q, of joints with one coordinate each."""
        nq = self.model.nq

        def rates(_, x):
            return np.concatenate([x[nq:], self.accelerations(x[:nq], x[nq:])])

        found: Any = solve_ivp(rates, (0, stop), np.concatenate([q, 0 * q]), "DOP853", rtol=1e-10, atol=1e-10)
        return found.y[:nq, -1]

    def stepped(self, stop: float) -> np.ndarray:
        """Positions of all joints at the end of a motion of a tree from rest, ball and free joints included."""
        self.lib.mj_resetData(self.model, self.data)
        self.model.opt.integrator = self.lib.mjtIntegrator.mjINT_RK4
        self.model.opt.timestep = 1e-3
        for _ in range(round(stop / 1e-3)):
            self.lib.mj_step(self.model, self.data)
        return self.data.qpos.copy()
