"""How well a calibration knows the tool: by the poses that were fitted, and what the tape measure knows of the rest.

    J_i S = U diag(s) V'         directions v with s < noise / tape are known better by tape than by the poses
    |G_i S v| tape               by which such a direction moves the tool, root mean square over the places

Directions that move the tool nowhere are harmless, whatever numbers take part in them: six links and turntables have many.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gantrytau import Model
from gantrytau.describing.record import Record
from gantrytau_optimica.calibration.design.identifiability import PoseArrays
from gantrytau_optimica.calibration.design.pose_selection import predict
from gantrytau_optimica.calibration.links.arm_closure import Orientation, read_arms
from gantrytau_optimica.calibration.links.arm_factors import scales
from gantrytau_optimica.calibration.links.arm_poses import tool_gain

PART = 0.3  # of the largest share of a direction, from which on a number is named
NAMED = 4  # numbers of a direction


@dataclass(frozen=True)
class Loose:
    """A combination of numbers that poses do not hold: those that take part most, and by how much it moves the tool, m."""

    names: tuple[str, ...]
    moves: float


@dataclass(frozen=True, eq=False)
class ToolError(Record):
    """The error of the tool to be expected, (N,) in m at each place, and what poses do not hold, the worst first."""

    position: np.ndarray
    loose: tuple[Loose, ...]

    @property
    def error(self) -> float:
        """Mean of `position`, m."""
        return float(self.position.mean())


def tool_error(
    robot: Model,
    fitted: PoseArrays,
    at: PoseArrays,
    *,
    noise: float,
    angle: float = 0.0,
    tape: float,
    orientation: Orientation = "local",
    certainty: np.ndarray | None = None,
) -> ToolError:
    """What a fit to some poses knows of the tool at others.

    fitted, at: poses of the robot itself, which close its links, without R where the plate cannot turn; noise, angle:
    deviations of a measured pose per axis, m and rad; tape: of nominal values, m at the joints; certainty: of the fitted
    poses, (N,), by which deviations are divided.
    """
    noise = max(noise, 1e-9)
    expected = predict(
        robot,
        fitted,
        at=at,
        noise=noise,
        angle=angle,
        tape=tape,
        orientation=orientation,
        certainty=certainty,
    ).position
    arms, found = read_arms(robot, orientation), []
    for arm, (gain, _) in zip(arms, tool_gain(arms, *at), strict=True):
        J = arm.closure(*fitted)[1] * scales(arm)
        J = J if certainty is None else J * certainty[:, None, None]
        _, s, V = np.linalg.svd(np.linalg.qr(J.reshape(-1, arm.count), mode="r"))
        known = np.zeros(arm.count)
        known[: len(s)] = s
        loose = V[known < noise / tape]
        found += _apart(loose, gain[:, :3] * scales(arm), arm.names, tape)
    return ToolError(expected, tuple(sorted(found, key=lambda one: -one.moves)))


def _apart(loose: np.ndarray, gain: np.ndarray, names: Sequence[str], tape: float) -> list[Loose]:
    """A space of directions (k, p), split into those that move the tool and those that do not."""
    moved = gain @ loose.T
    squares, turned = np.linalg.eigh(np.einsum("nik,nil->kl", moved, moved) / len(gain))
    found = []
    for square, v in zip(squares, (loose.T @ turned).T, strict=True):
        most = [k for k in np.argsort(-np.abs(v)) if abs(v[k]) > PART * np.abs(v).max()][:NAMED]
        found.append(Loose(tuple(str(names[int(k)]) for k in most), tape * float(np.sqrt(max(square, 0.0)))))
    return found
