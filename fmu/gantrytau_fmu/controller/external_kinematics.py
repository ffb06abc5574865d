"""Kinematics from outside: poses in, positions of axes out, with a status."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gantrytau.border.refusal import USERS_ERRORS, ModelError, SolveError, in_words
from gantrytau.describing.record import Record
from gantrytau.kinematics.kinematics import Kinematics
from gantrytau_fmu.controller.channels import Channel, Declaration, Values


@dataclass(frozen=True)
class ExternalKinematics(Record):
    """Where the axes have to be for a pose: `function(pose) -> axes`, or `(axes, status)`.

    poses: channels that references of the controller have in place of those of the axes; function: takes their numbers
    (n,), gives those of the axes, and a status, "" where all is well, else in words; axes: inputs of the plant.
    Axes that are not finite are out of reach. Raises ModelError without poses or axes.
    """

    function: Callable[[Values], Any]
    poses: Sequence[Channel]
    axes: Sequence[str]

    def __post_init__(self):
        if not callable(self.function):
            raise ModelError(f"kinematics: found {self.function!r}, expected a function of a pose (n,)")
        if not self.declaration.size or not self.axes or isinstance(self.axes, str):
            raise ModelError(
                f"kinematics: found poses={self.declaration.names} and axes={self.axes!r}, expected channels, and names of "
                "inputs of the plant in a list"
            )

    @classmethod
    def of(cls, kinematics: Kinematics, axes: Sequence[str], pose: str = "r_ref") -> "ExternalKinematics":
        """Those of a robot by its model, for the position (3,) of its tool, m; axes: inputs, in the order of its joints."""
        return cls(kinematics.ik, (Channel(pose, "m", 3),), axes)

    @property
    def declaration(self) -> Declaration:
        """Of a pose."""
        return Declaration(self.poses)

    def axes_of(self, pose: Values, size: int) -> tuple[Values, str]:
        """The positions of `size` axes, and a status, "" where all is well. SolveError for an answer of another kind."""
        try:
            found = self.function(pose)
            axes, status = found if isinstance(found, tuple) else (found, "")
            axes = np.asarray(axes, dtype=float).ravel()
        except USERS_ERRORS as error:  # whatever a function of the user raises
            raise SolveError(
                f"kinematics: raised {type(error).__name__}: {in_words(error)}; mend the function"
            ) from error
        if axes.size != size:
            raise SolveError(f"kinematics: answered {axes.size} numbers, expected {size}, one for each axis")
        return axes, str(status) or ("" if np.isfinite(axes).all() else "out of reach")
