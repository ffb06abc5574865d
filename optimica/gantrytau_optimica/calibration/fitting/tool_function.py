"""The tool of any robot by its joints and by parameters that have names in its model, over many poses."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gantrytau import Dae, Model, ModelError, translate
from gantrytau.border.checks import instance
from gantrytau.border.refusal import Given, did_you_mean
from gantrytau.describing.record import Record
from gantrytau.kinematics.kinematics import driven_joints
from gantrytau.kinematics.model_functions import SPIN, orientations
from gantrytau_optimica.calibration.links.arm_factors import LEVER

Array = np.ndarray


@dataclass(frozen=True, eq=False)
class ToolFunction(Record):
    """joints: columns of q; names: parameters that are free, scalars, (k,); nominal: their values; turning: whether the
    orientation of the tool is asked for.
    """

    dae: Dae
    joints: tuple[str, ...]
    names: tuple[str, ...]
    nominal: Array
    turning: bool
    tool: str = "tool"

    @cached_property
    def scale(self) -> Array:
        """Scale of each parameter: change for a metre at the tool, about, (k,)."""
        units = [self._unit(name) for name in self.names]
        known = {"m": 1.0, "rad": 1 / LEVER}
        return np.array([known.get(u, max(abs(x), 1.0)) for u, x in zip(units, self.nominal, strict=True)])

    def _unit(self, name: str) -> str:
        return next((p.unit for p in self.dae.flat.parameters if name in p.elements), None) or "1"

    def __call__(self, q: Array, p: Array) -> tuple[Array, Array | None]:
        """Places (N, 3) and orientations (N, 3, 3) of the tool, on the branch of the start; NaN where there is none."""
        found = self._function(*self._arguments(q, p))
        return found[0], found[1].reshape(-1, 3, 3).transpose(0, 2, 1) if self.turning else None

    def jacobian(self, q: Array, p: Array) -> Array:
        """Derivatives by the parameters of the place, and of a turn in the world where it is asked for, (N, 3 or 6, k)."""
        by_all = self._function.jacobian(*self._arguments(q, p))[:, :, len(self.joints) :]
        if not self.turning:
            return by_all
        R = self(q, p)[1]
        assert R is not None
        spins = by_all[:, 3:].reshape(len(q), 3, 3, -1).transpose(0, 3, 2, 1) @ np.swapaxes(R, 1, 2)[:, None]
        return np.concatenate([by_all[:, :3], np.stack([spins[:, :, i, j] for i, j in SPIN], axis=1)], axis=1)

    @cached_property
    def _function(self):
        wanted = [f"{self.tool}.r", *(n for n in orientations(self.tool) if n in self.dae.vectors)]
        return self.dae.array_function([*self.joints, *self.names], wanted[: 1 + self.turning])

    def _arguments(self, q: Array, p: Array) -> list[Array]:
        return [*q.T, *np.repeat(p[:, None], len(q), axis=1)]


def tool_function(
    robot: Model, parameters: Sequence[str], joints: Sequence[str] | None, turning: bool, tool: str = "tool"
) -> ToolFunction:
    """The function of a robot; ModelError for one without tool, driven joints or a parameter of such a name."""
    instance("calibrate", "robot", robot, Model, "a model instance with a tool and driven joints")
    if isinstance(parameters, str) or not parameters:
        found = Given("parameters", parameters)
        expected = "expected a list of names of the model, as ['upper.r', 'h']"
        raise ModelError(expected, place="calibrate", found=found)
    dae = translate(robot, units=False)
    if f"{tool}.r" not in dae.vectors:
        raise ModelError(f"{dae.name} has no '{tool}.r', expected the position of a tool", place="calibrate")
    if turning and not any(name in dae.vectors for name in orientations(tool)):
        missing = f"found orientations R and no '{tool}.R' of {dae.name}, expected measurements without R"
        raise ModelError(missing, place="calibrate")
    known = {name: p for p in dae.flat.parameters for name in (p.name, *p.elements)}
    wrong = next((name for name in parameters if name not in known), None)
    if wrong is not None:
        message = f"{dae.name} has no parameter '{wrong}'{did_you_mean(wrong, known)}"
        raise ModelError(message, place="calibrate", argument="parameters")
    names = dict.fromkeys(
        n for name in parameters for n in (known[name].elements if name == known[name].name else [name])
    )
    values = np.array([dae.parameter_values[name] for name in names])
    given = driven_joints(dae) if joints is None else joints
    columns = tuple(scalar for name in given for scalar in dae.expand(name))
    return ToolFunction(dae, columns, tuple(names), values, turning, tool)
