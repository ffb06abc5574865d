"""A robot whose joints answer as the linear servos of Dressler (2012), (6.11), and whose tool swings about them."""

import numpy as np
from scipy.signal import lfilter

from gantrytau import Result, StateSpace
from gantrytau.kinematics import Kinematics
from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica.learning import Reference

PERIOD = 0.004
SERVOS = [(0.03527, 0.9647), (0.03425, 0.9656), (0.02748, 0.9728)]  # b and a of (6.11)
DELAY = 5  # samples
KINEMATICS = Kinematics(GantryTau(prototypes.L1))
PLACE = (0.9, 2.7, -0.7)


def servo(b: float, a: float, period: float = PERIOD) -> StateSpace:
    """(6.11): q^-d b / (1 - a q^-1)."""
    A = np.eye(DELAY, k=-1)
    A[0, 0] = a
    return StateSpace(A, b * np.eye(DELAY)[:, :1], np.eye(DELAY)[-1:], 0, period=period)


RESPONSE = [servo(*each) for each in SERVOS]


class LinearPlant:
    """fails: the number of the run that breaks down; swing: of the tool beside stiff arms, Hz and damping; late: samples
    by which servos answer later than (6.11); limit: of what they answer to, m; lost: rows at the end of a run.
    """

    period = PERIOD
    kinematics = KINEMATICS

    def __init__(
        self,
        noise: float = 0.0,
        fails: int | None = None,
        swing: tuple[float, float] | None = None,
        *,
        late: int = 0,
        limit: float = np.inf,
        lost: int = 0,
    ):
        self.noise, self.fails, self.swing, self.runs = noise, fails, swing, 0
        self.late, self.limit, self.lost = late, limit, lost

    def run(self, position: np.ndarray, velocity: np.ndarray, seed: int = 0) -> Result:
        if self.runs == self.fails:
            raise KeyboardInterrupt
        self.runs += 1
        moved = np.clip(position - position[0], -self.limit, self.limit)
        q = np.column_stack(
            [
                lfilter([*np.zeros(DELAY + self.late), b], [1, -a], x)
                for (b, a), x in zip(SERVOS, moved.T, strict=True)
            ]
        )
        q = position[0] + q + self.noise * np.random.default_rng(seed).standard_normal(q.shape)
        r = KINEMATICS.fk(q)[0]
        if self.swing:
            w, d = 2 * np.pi * self.swing[0] * PERIOD, self.swing[1]
            a1, a2 = 2 * np.exp(-d * w) * np.cos(w * np.sqrt(1 - d**2)), -np.exp(-2 * d * w)
            r = r[0] + lfilter([0, 1 - a1 - a2], [1, -a1, -a2], r - r[0], axis=0)
        columns = {"measured.q": q, "measured.r": r, "q_ref": position}
        rows = len(q) - self.lost
        values = {f"{name}[{k}]": x[:rows] for name, array in columns.items() for k, x in enumerate(array.T)}
        return Result(PERIOD * np.arange(rows), values)


def line(samples: int = 400, length: float = 0.01) -> Reference:
    """Along x there and back, with 0.4 s of rest before."""
    t = PERIOD * np.arange(samples)
    share = np.clip((t - 0.4) / (t[-1] - 0.8), 0, 1)
    r = np.tile(PLACE, (samples, 1))
    r[:, 0] += length * np.sin(np.pi * share) ** 4
    return Reference(t, r)
