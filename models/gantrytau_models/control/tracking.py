"""A robot that tracks a reference of its tool: feedforward and controller, and the loop closed with the robot."""

from collections.abc import Mapping, Sequence
from typing import Any

from gantrytau import Fixed, Input, Model, ModelError, Output, Parameter, connect
from gantrytau.mechanics.translational import Friction, TanhFriction
from gantrytau_models.control.closed_form_kinematics import carts_behind
from gantrytau_models.control.controllers import CascadedController, Controller
from gantrytau_models.control.feedforward import Feedforward
from gantrytau_models.control.plant import MeasuredGantryTau
from gantrytau_models.mechanisms.gantry_tau import tool_ahead_of_carts
from gantrytau_models.prototypes import Prototype


class TrackingController(Model):
    """From a reference `r_ref` of the tool and measured `q`, `v` to forces `f`: feedforward and a controller.

    control: a class such as `PidController`, or one with gains of yours, as `PidController(prototypes.L1,
    bandwidth=25.0)`; friction: that of the robot inside the feedforward; start: where the tool is at the start, (3,)
    in m. Further keywords modify members. What
    is tracked is the reference behind its filters, `feedforward.r`. A reference of its own is the equation of a
    subclass that declares `r_ref` anew, as Real. Raises ModelError for what is no controller.
    """

    r_ref = Input(3, unit="m", description="reference of the tool position, resolved in the world")
    q = Input(3, unit="m", description="measured positions of the carts")
    v = Input(3, unit="m/s", start=0.0, description="measured speeds of the carts")
    f = Output(3, unit="N", description="forces of the actuators, held between samples")
    tau = Output(3, unit="N.m", description="torques of the motors that give f")
    feedforward_share = Parameter(1.0, unit="1", description="part of the feedforward that is used, 0 to 1")
    feedforward = Feedforward.open()
    control = CascadedController.open()

    def __init__(
        self,
        prototype: Prototype,
        *,
        control: type[Controller] | Controller = CascadedController,
        friction: type[Friction] | None = TanhFriction,
        start: Sequence[float] | None = None,
        **modifications: Any,
    ):
        tool = tool_ahead_of_carts(prototype) if start is None else list(start)
        if isinstance(control, type) and issubclass(control, Controller):
            control = control(prototype, start=tool)
        if not isinstance(control, Controller):
            raise ModelError(
                f"{type(self).__name__}: found control={control!r}, expected a class such as CascadedController, or "
                "one with gains, as CascadedController(prototypes.L1, k_p=15.0)"
            )
        defaults = dict(
            r_ref=dict(start=tool),
            q=dict(start=carts_behind(prototype, tool)),
            feedforward=Feedforward(prototype, friction=friction, start=tool).modifications,
        )
        super().__init__(defaults, control=control, **modifications)

    def equations(self):
        yield self.feedforward.r_ref == self.r_ref
        yield self.control.q == self.q
        yield self.control.v == self.v
        yield from self.control.follow(self.feedforward, self.feedforward_share)
        yield self.f == self.control.f
        yield self.tau == self.control.tau


class ControlledRobot(Model):
    """The robot and its controller as one model; `error` is what the tool lags behind its filtered reference.

    Arguments as of `TrackingController`; `controller=dict(feedforward_share=0.0)` has further ones for it alone, and
    `robot=dict(plate_mass=12.0)` makes the robot differ from what it knows. The tool begins at rest at `start`.
    """

    r_ref = Input(3, unit="m", description="reference of the tool position, resolved in the world")
    r = Output(3, unit="m", description="position of the tool")
    error = Output(3, unit="m", description="filtered reference less position of the tool")
    robot = MeasuredGantryTau.open()
    controller = TrackingController.open()

    def __init__(
        self,
        prototype: Prototype,
        *,
        control: type[Controller] | Controller = CascadedController,
        friction: type[Friction] | None = TanhFriction,
        start: Sequence[float] | None = None,
        controller: Mapping[str, Any] | None = None,
        **modifications: Any,
    ):
        tool = tool_ahead_of_carts(prototype) if start is None else list(start)
        at_rest = dict(r=Fixed(tool), v=Fixed(0.0))
        arguments: dict[str, Any] = dict(control=control, friction=friction, start=tool) | dict(
            controller or {}
        )
        defaults = dict(
            r_ref=dict(start=tool),
            robot=MeasuredGantryTau(prototype, friction=friction, tool=at_rest).modifications,
            controller=TrackingController(prototype, **arguments).modifications,
        )
        super().__init__(defaults, **modifications)

    def equations(self):
        yield connect(self.r_ref, self.controller.r_ref)
        yield connect(self.robot.q, self.controller.q)
        yield connect(self.robot.v, self.controller.v)
        for k, cart in enumerate(self.robot.carts):
            yield cart.f == self.controller.f[k]
        yield self.r == self.robot.tool.r
        yield self.error == self.controller.feedforward.r - self.r
