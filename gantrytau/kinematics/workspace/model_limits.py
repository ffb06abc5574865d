"""What limits the poses of a robot through its equations: joints, driven and passive, obstacles, singular poses."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gantrytau.border.checks import array, instance
from gantrytau.border.refusal import Given, ModelError, did_you_mean
from gantrytau.kinematics.kinematics import Kinematics
from gantrytau.kinematics.poses import poses
from gantrytau.kinematics.workspace.obstacles import segment_distance
from gantrytau.kinematics.workspace.pose_limits import REASONS, Examined, Limits, in_blocks, strokes_of
from gantrytau.language.self_description.appearance import Stick

BLOCK = 32768  # poses, as many as array functions take together
# limits of robots whose links are known
LINKS = ("ball_joint", "cart_axes", "plate_axes", "home", "angle_margin")


class ModelExaminer:
    """A robot through its equations made ready for many poses, with limits; bars that it shows are its links."""

    def __init__(self, kinematics: Kinematics, limits: Limits):
        self.kinematics, self.limits = kinematics, limits
        self.name = kinematics.dae.name
        for name in LINKS:
            if getattr(limits, name) != getattr(Limits, name):
                raise ModelError(
                    f"{self.name}: found Limits.{name} of a robot that does not say by rods() what its links are; limit "
                    "passive joints by passive={name: (least, largest)}",
                    argument=name,
                )
        joints = kinematics.joints
        self.strokes = strokes_of(kinematics, len(joints), limits.strokes)
        units = [kinematics.dae.flat.find(name) for name in joints]
        self._slides = np.array([variable is not None and variable.unit == "m" for variable in units])
        self.passive = _passive(kinematics, limits.passive)
        self.bars = _bars(kinematics) if limits.obstacles else []

    @property
    def rails(self) -> np.ndarray:
        """None that are known."""
        return np.zeros((0, 2, 3))

    def __call__(self, r: ArrayLike, R: ArrayLike | None = None) -> Examined:
        """See `examine`."""
        at = poses(r, R, self.name)
        turns = at.R
        if turns is None and self.kinematics.turning:
            turns = np.broadcast_to(self.kinematics.home.R, (len(at.r), 3, 3))
        return in_blocks(
            at.r, lambda part: self._of_block(at.r[part], None if turns is None else turns[part]), BLOCK
        )

    def _of_block(self, r: np.ndarray, R: np.ndarray | None) -> dict[str, np.ndarray]:
        q = self.kinematics.within_a_turn(self.kinematics.ik(r, R), self.strokes)
        reached = np.isfinite(q).all(axis=1)
        stroke, turn = self._strokes_left(q)
        angle = np.where(reached, np.inf, np.nan)
        clearance, condition, passive = (np.full(len(r), np.nan) for _ in range(3))
        reason = np.where(reached, 0, REASONS.index("out of reach"))
        reason[reached & ((stroke < 0) | (turn < 0))] = REASONS.index("stroke")
        for word, values, left in (
            ("passive joint", passive, self._passive_left),
            ("near singular", condition, self._condition),
            ("collision", clearance, self._clearance),
        ):
            free = np.flatnonzero(reason == 0)
            values[free] = left(r[free], None if R is None else R[free])
            limit = values if word != "near singular" else self.limits.condition - values
            with np.errstate(invalid="ignore"):
                reason[free[~(limit[free] >= 0)]] = REASONS.index(word)
        if R is None:
            R = np.array(np.broadcast_to(self.kinematics.home.R, (len(r), 3, 3)))
        return dict(
            R=R,
            q=q,
            reason=reason,
            stroke=stroke,
            turn=turn,
            angle=angle,
            clearance=clearance,
            condition=condition,
        )

    def _strokes_left(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of joints that slide in m and of those that turn in rad, (N,) each."""
        left = np.minimum(q - self.strokes[:, 0], self.strokes[:, 1] - q)
        unlimited = np.where(np.isnan(q[:, :1]), np.nan, np.inf)
        slides, turns = (
            np.hstack([unlimited, left[:, which]]).min(axis=1) for which in (self._slides, ~self._slides)
        )
        return slides - self.limits.stroke_margin, turns - self.limits.turn_margin

    def _passive_left(self, r: np.ndarray, R: np.ndarray | None) -> np.ndarray:
        """Of the passive joint that is nearest to its limit, (N,)."""
        if not self.passive:
            return np.full(len(r), np.inf)
        found = self.kinematics.variables(list(self.passive), r, R)
        left = [
            np.minimum(x[:, 0] - low, high - x[:, 0])
            for x, (low, high) in zip(found, self.passive.values(), strict=True)
        ]
        return np.min(left, axis=0)

    def _condition(self, r: np.ndarray, R: np.ndarray | None) -> np.ndarray:
        """Ratio of the largest and the least speed of the tool, (N,); 1 where it is not asked for."""
        if not math.isfinite(self.limits.condition):
            return np.ones(len(r))
        rates = self.kinematics.rates(r, R)
        rates[:, 3:] *= self.limits.lever
        found = np.full(len(r), np.inf)
        known = np.isfinite(rates).all(axis=(1, 2))
        sizes = np.linalg.svd(rates[known], compute_uv=False)[:, : min(rates.shape[1:])]
        with np.errstate(divide="ignore"):
            found[known] = sizes[:, 0] / sizes[:, -1]
        return found

    def _clearance(self, r: np.ndarray, R: np.ndarray | None) -> np.ndarray:
        """Of bars and plate from obstacles, (N,) in m."""
        least = np.full(len(r), np.inf)
        if not (len(r) and self.limits.obstacles):
            return least
        names = [name for bar in self.bars for name in bar]
        ends = self.kinematics.variables(names, r, R) if names else []
        turns = self.kinematics.orientation(r) if R is None and self.limits.plate else R
        for obstacle in self.limits.obstacles:
            for a, b in zip(ends[::2], ends[1::2], strict=True):
                least = np.minimum(least, segment_distance(obstacle, a, b) - self.limits.link_radius)
            for body in self.limits.plate:
                assert turns is not None  # as there is a plate
                plate = segment_distance(obstacle, r + turns @ body.start, r + turns @ body.end) - body.radius
                least = np.minimum(least, plate)
        return least - self.limits.clearance


def _passive(kinematics: Kinematics, passive: Any) -> dict[str, tuple[float, float]]:
    """Limits of passive joints by name; ModelError for what they cannot be."""
    if passive is None:
        return {}
    instance("Limits", "passive", passive, Mapping, "(least, largest) by name of a variable")
    found = {}
    for name, bounds in passive.items():
        if name not in kinematics.dae.variables:
            raise ModelError(
                f"Limits.passive: {kinematics.dae.name} has no scalar variable '{name}'"
                f"{did_you_mean(str(name), kinematics.dae.variables)}",
                argument="passive",
            )
        pair = array("Limits", "passive", bounds, (2,), finite=False)
        if not pair[0] < pair[1]:
            wrong = Given("passive", {name: bounds})
            raise ModelError("expected (least, largest)", place="Limits", found=wrong)
        found[name] = (float(pair[0]), float(pair[1]))
    return found


def _bars(kinematics: Kinematics) -> list[tuple[str, str]]:
    """Names of the ends of bars that the robot shows, where both are places of the model."""
    known = set(kinematics.dae.vectors)
    sticks = [shape for shape in kinematics.dae.flat.shapes if isinstance(shape, Stick)]
    return [
        (s.a, s.b) for s in sticks if isinstance(s.a, str) and isinstance(s.b, str) and {s.a, s.b} <= known
    ]
