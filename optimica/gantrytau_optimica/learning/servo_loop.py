"""A robot and one controller for each of its joints, as one model."""

import re
from collections.abc import Sequence
from typing import Any

from gantrytau import Array, Input, Model, ModelError, Real, connect, der
from gantrytau.border.checks import instance
from gantrytau.mechanics.multibody import WorldForce

PORTS = ("q_ref", "v_ref", "q", "v", "f_ff", "f")  # of a controller


def servo_loop(model: Model, controllers: Sequence[Model], joints: Sequence[str]) -> Model:
    """The model `robot` with `controllers`, driven by the references q_ref (n,) and v_ref (n,) of its joints.

    Where the robot has a `tool` with a frame, a force `push.f` acts on it; where it has an `accelerometer`, `gained` is
    the integral of what it senses.
    Raises ModelError for controllers that are not one for each joint, with the ports q_ref, v_ref, q, v, f_ff and f.
    """
    _check(controllers, joints)
    n, unit = len(joints), unit_of(joints)
    one_each, struck = list(controllers), tool_frame(model)

    class ServoLoop(Model):
        """A robot under its servos."""

        q_ref = Input(n, unit=unit, description="references of the positions")
        v_ref = Input(n, unit=f"{unit}/s", start=0.0, description="references of the speeds")
        robot = model
        controllers = Array(Model, one_each)

        def equations(self):
            ones: Any = self.controllers
            for k, (joint, one) in enumerate(zip(joints, ones, strict=True)):
                q, v, f = (_member(self.robot, name) for name in drive(joint))
                yield one.q_ref == self.q_ref[k]
                yield one.v_ref == self.v_ref[k]
                yield one.q == q
                yield one.v == v
                yield f == one.f

    class PushedLoop(ServoLoop):
        """The same with a force on the tool."""

        push = WorldForce()

        def equations(self):
            yield from super().equations()
            yield connect(self.push.frame_b, _member(self.robot, struck or ""))

    loop: Any = PushedLoop if struck else ServoLoop

    class SensedLoop(loop):
        """The same with an accelerometer that is read."""

        gained = Real(
            3, unit="m/s", start=0.0, fixed=True, description="integral of what is sensed, from rest"
        )

        def equations(self):
            yield from super().equations()
            yield der(self.gained) == self.robot.accelerometer.a

    return SensedLoop() if senses(model) else loop()


def senses(model: Model) -> bool:
    """Whether a robot has an accelerometer."""
    sensor = type(model).members().get("accelerometer")
    return isinstance(sensor, Model) and "a" in type(sensor).members()


def _check(controllers: Sequence[Model], joints: Sequence[str]) -> None:
    n = len(joints)
    instance("Rig", "controllers", controllers, Sequence, "a list, one for each joint")
    if len(controllers) != n:
        raise ModelError(
            f"Rig: found {len(controllers)} controllers, expected one for each joint: {', '.join(joints)}"
        )
    for k, one in enumerate(controllers):
        missing = [port for port in PORTS if not isinstance(one, Model) or port not in type(one).members()]
        if missing:
            raise ModelError(
                f"Rig: controllers[{k}]: found {one!r} without {', '.join(missing)}, expected a component such as "
                f"CartServo with {', '.join(PORTS)}"
            )
    if len({unit_of([joint]) for joint in joints}) > 1:
        raise ModelError(
            f"Rig: found the joints {', '.join(joints)}, expected joints that all slide, x.s, or all turn, x.phi"
        )


def unit_of(joints: Sequence[str]) -> str:
    """Of the positions of joints."""
    return "rad" if joints[0].endswith(".phi") else "m"


def drive(joint: str) -> tuple[str, str, str]:
    """Names of position, speed and force of a joint x.s that slides, or x.phi that turns."""
    owner, _, last = joint.rpartition(".")
    return (joint, f"{owner}.v", f"{owner}.f") if last == "s" else (joint, f"{owner}.w", f"{owner}.tau")


def tool_frame(model: Model) -> str | None:
    """The frame of the tool of a robot, None where it has none."""
    tool = type(model).members().get("tool")
    if not isinstance(tool, Model):
        return None
    return next((f"tool.{name}" for name in ("frame", "frame_a") if name in type(tool).members()), None)


def _member(owner: Any, path: str) -> Any:
    """What a dotted path such as `carts[0]` leads to."""
    for word in re.findall(r"\w+", path):
        owner = owner[int(word)] if word.isdigit() else getattr(owner, word)
    return owner
