"""Between a tool and the joints that move it, as a controller knows it."""

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from gantrytau import ModelError

AXES = 3


class PoseMap(Protocol):
    """What learning needs of kinematics, as `Kinematics` has it."""

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, the columns of q."""
        ...

    @property
    def limits(self) -> np.ndarray:
        """Bounds of the joints, (n, 2)."""
        ...

    def ik(self, r: Any) -> np.ndarray:
        """Joints q (N, n) for the tool at r (N, 3), NaN where it is out of reach; (n,) for one."""
        ...

    def fk(self, q: Any) -> tuple[np.ndarray, Any]:
        """The tool r (N, 3) for joints q (N, n), and what else is known of the pose; (3,) for one."""
        ...


class StraightAxes:
    """A machine without a tool of its own, whose one to three joints move it along x, y and z of the world.

    joints: their names, of x first. Raises ModelError for none, and for more than three.
    """

    def __init__(self, joints: Sequence[str]):
        if not 1 <= len(joints) <= AXES:
            raise ModelError(
                f"StraightAxes: found the joints {', '.join(joints) or 'none'}, expected one to three, along x, y and z; a "
                "robot of more has a component `tool`"
            )
        self.joints = tuple(joints)

    def __repr__(self) -> str:
        return f"<StraightAxes: {', '.join(self.joints)}>"

    @property
    def limits(self) -> np.ndarray:
        """None, (n, 2)."""
        return np.tile([-np.inf, np.inf], (len(self.joints), 1))

    def ik(self, r: Any) -> np.ndarray:
        """Joints (N, n) for r (N, 3); NaN where an axis that is not there would have to move."""
        r = np.asarray(r, dtype=float)
        found = r[..., : len(self.joints)].copy()
        found[np.any(r[..., len(self.joints) :] != 0, axis=-1)] = np.nan
        return found

    def fk(self, q: Any) -> tuple[np.ndarray, None]:
        """The place r (N, 3) of joints (N, n), zero along axes that are not there."""
        q = np.asarray(q, dtype=float)
        return np.concatenate([q, np.zeros((*q.shape[:-1], AXES - q.shape[-1]))], axis=-1), None
