"""Which poses of any robot keep its limits: by its links where it names them, else through its equations."""

from numpy.typing import ArrayLike

from gantrytau.border.checks import instance
from gantrytau.kinematics.kinematics import Kinematics
from gantrytau.kinematics.workspace.model_limits import ModelExaminer
from gantrytau.kinematics.workspace.pose_limits import Examined, Examiner, Limits
from gantrytau.language.model import Model


def examine(
    robot: Model | Kinematics, r: ArrayLike, R: ArrayLike | None = None, limits: Limits | None = None
) -> Examined:
    """Poses of a robot beside its limits: which keep all, and how far each limit is away.

    robot: an instance such as GantryTau(prototypes.L1), or its Kinematics; r: (N, 3) or (3,) in m; R: (N, 3, 3), one
    (3, 3) for all, or None for the orientation that the links give, and for a robot that turns its tool that of its start.
    Raises ModelError for other models, limits that the robot does not have, and wrong shapes.
    """
    return examiner_of(robot, limits or Limits())(r, R)


def examiner_of(robot: Model | Kinematics, limits: Limits) -> Examiner | ModelExaminer:
    """A robot made ready for many poses, with limits."""
    instance("workspace", "limits", limits, Limits, "Limits, such as Limits(strokes=(0.0, 2.0))")
    kinematics = robot if isinstance(robot, Kinematics) else Kinematics(robot)
    return (ModelExaminer if kinematics.through_equations else Examiner)(kinematics, limits)
