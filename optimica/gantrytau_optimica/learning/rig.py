"""A simulated robot under its servos, run after run: references in, what is measured out."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from gantrytau import Model, ModelError, Result, Samples, linearize, simulate, translate
from gantrytau.border.checks import array, instance, number, whole
from gantrytau.border.refusal import StructureError
from gantrytau.dae import Dae
from gantrytau.kinematics import Kinematics
from gantrytau.kinematics.kinematics import driven_joints
from gantrytau_optimica.learning.pose_maps import PoseMap, StraightAxes
from gantrytau_optimica.learning.run_variation import STILL, Scatter
from gantrytau_optimica.learning.sensor_noise import period_means, with_readings
from gantrytau_optimica.learning.servo_loop import drive, servo_loop, unit_of

TOLERANCE = 2e-4  # of a run: joints within 4 nm of an FMU at 1e-6 over four runs of learning, far below the noise of devices
KEPT = 8  # places to start from, each with equations made ready
SHOWN = ("tool.r", "tool.v", "gauge.r", "accelerometer.a", "frame.s")  # what of it a robot has
SEEN = ("gauge.r", "tool.r")  # the first of these that a robot has is what gauges read


class Rig:
    """A robot model with a controller for each driven joint, that runs references given every `period` seconds.

    controllers: components such as `gantrytau_models.CartServo`, one for each force x.f beside x.s, or `JointServo` for
    each torque x.tau beside x.phi, where x is a component of the model, with q_ref, v_ref, q, v, f_ff and f. noise: what
    differs from run to run (`Scatter`), nothing if None; friction that differs is one with the inputs `level` and `z_0`,
    such as `PreslidingFriction`. stiff: the robot that does not give way, whose `kinematics` the controllers go by; by
    default the model itself.
    Translation takes about a second, once; each run some tenths of one.
    Raises ModelError for a period that is not above zero or not that of the controllers, controllers that do not fit, and
    friction that cannot differ although it should.
    """

    def __init__(
        self,
        model: Model,
        controllers: Sequence[Model],
        *,
        period: float,
        noise: Scatter | None = None,
        stiff: Model | None = None,
    ):
        self.period = number("Rig", "period", period, above=0.0)
        instance("Rig", "noise", noise, Scatter | None, "a Scatter, or None for none")
        self._stiff = stiff
        self._kinematics: PoseMap | None = None
        self.noise = STILL if noise is None else noise
        self.robot = translate(model)
        try:
            self.joints = driven_joints(self.robot)
        except ModelError as error:
            raise ModelError(
                f"found {self.robot.name} with the inputs {', '.join(self.robot.inputs) or 'none'}, expected forces "
                "x.f beside x.s and x.v, or torques x.tau beside x.phi and x.w; make what is driven a component x",
                place="Rig",
                argument="model",
            ) from error
        self.loop = translate(servo_loop(model, controllers, self.joints), events=True)
        for k in range(len(self.joints)):
            own = self.loop.parameter_values.get(f"controllers[{k}].period", period)
            if abs(own - period) > 1e-9 * period:
                raise ModelError(
                    f"Rig: found controllers[{k}] with the period {own:g} s, expected that of the rig, {period:g} s"
                )
        self._laws = tuple(self._law(joint) for joint in self.joints)
        self._started = dict[tuple[float, ...], tuple[Dae, np.ndarray]]()

    def run(
        self,
        position: ArrayLike,
        velocity: ArrayLike | None = None,
        seed: int = 0,
        *,
        push: ArrayLike | None = None,
    ) -> Result:
        """What the robot does for references of its joints, position (N, n) in m and velocity (N, n) in m/s, none if None.

        It rests at the first position before. Row k of a reference is given at k times the period, and held; so is that
        of `push`, a force (N, 3) in N on the tool, resolved in the world, as of a hammer. The result
        has N rows, at these times: joints, forces and friction by their names in the robot, `tool.r`, `gauge.r` and
        `accelerometer.a` where it has them, `q_ref` and `v_ref`; readings with noise are `measured.q`, `measured.r` (of
        the gauge, else of the tool), `measured.f` and `measured.a`, the means over a period around each sample: forces
        that change with the clock shake a robot at multiples of it, which single values would take for slow motion. Equal
        seeds draw the same friction and noise: take another for each run. Raises ModelError for references of another
        shape or not finite, InitializationError where the robot cannot rest at the first, SolveError where the simulation
        stops.
        """
        whole("Rig.run", "seed", seed, least=0)
        q_ref, v_ref = self._references(position, velocity)
        random = np.random.default_rng(seed)
        t = self.period * np.arange(len(q_ref))
        loop, forces = self._at_rest(q_ref[0])
        drawn = {name: [value] for name, value in self._drawn(forces, random).items()}
        # all are samples, so that the equations of one run serve for the next
        series = {"q_ref": q_ref, "v_ref": v_ref, **drawn}
        if "push.f" in self.loop.vectors:
            force = np.zeros((len(t), 3)) if push is None else push
            series["push.f"] = array("Rig.run", "push", force, (len(t), 3))
        elif push is not None:
            words = f"found a push and {self.robot.name}, expected a robot with a tool that has a frame"
            raise ModelError(words, place="Rig.run", argument="push")
        inputs = {name: Samples(t[: len(u)], u, kind="constant") for name, u in series.items()}
        found = simulate(
            loop,
            stop=t[-1] + self.period / 2,
            inputs=inputs,
            outputs=[*(f"robot.{name}" for name in self._shown), "q_ref", "v_ref", *self._sensed],
            tolerance=TOLERANCE,
            points=2 * len(t),
        )
        # where references jump, the row behind
        rows = np.searchsorted(found.time, t + 1e-6 * self.period, side="right") - 1
        names = [name for name in found.names if not name.startswith("gained")]
        values = {name.removeprefix("robot."): found[name][rows] for name in names}
        units = {name.removeprefix("robot."): found.unit(name) for name in names}
        ends = np.searchsorted(found.time, t + (0.5 + 1e-6) * self.period, side="right") - 1
        sensed = [np.diff(found[name][ends], axis=0, prepend=0.0) / self.period for name in self._sensed]
        before = np.searchsorted(found.time, t - 1e-6 * self.period)
        forces = [found[f"robot.{drive(joint)[2]}"] for joint in self.joints]
        means = np.column_stack([period_means(f[before], f[rows], f[ends]) for f in forces])
        return self._with_readings(t, values, units, sensed, means, random)

    @property
    def kinematics(self) -> PoseMap:
        """Those of the robot that does not give way; of a machine without a tool `StraightAxes`.

        Raises ModelError for a robot that gives way without such a one, and for more than three joints without a tool.
        """
        if self._kinematics is None:
            self._kinematics = self._found_kinematics()
        return self._kinematics

    def _found_kinematics(self) -> PoseMap:
        if self._stiff is None and "tool.r" not in self.robot.vectors:
            return StraightAxes(self.joints)
        try:
            found = Kinematics(self.robot if self._stiff is None else self._stiff)
            found.ik(found.home.r)
            return found
        except StructureError:
            raise ModelError(
                f"Rig: found {self.robot.name}, whose joints do not determine its tool, as it gives way; name the "
                "robot that does not, Rig(..., stiff=GantryTau(record))",
                argument="stiff",
            ) from None

    def at_rest(self, q: ArrayLike, seed: int | None = None) -> tuple[Dae, dict[str, float]]:
        """The robot under its servos as it rests with its joints at q (n,), and the inputs that hold it there.

        To be exported as an FMU, `export_fmu(loop, "rig.fmu")`, or run by an Mpc, `Controller(loop, period=rig.period,
        starts=inputs)`, with q_ref and v_ref as inputs; nothing pushes. Friction is that of `run` with a seed, or at its
        nominal level. Raises ModelError for another shape, InitializationError where it cannot rest.
        """
        found = array("Rig.at_rest", "q", q, (len(self.joints),))
        loop, forces = self._at_rest(found)
        still = {name: 0.0 for name in loop.inputs if name.startswith("push.")}
        if seed is not None:
            whole("Rig.at_rest", "seed", seed, least=0)
            return loop, still | self._drawn(forces, np.random.default_rng(seed))
        for law in self._laws:
            if law is not None:
                still |= {f"robot.{law}.level": 1.0, f"robot.{law}.z_0": 0.0}
        return loop, still | {f"controllers[{k}].f_ff": float(force) for k, force in enumerate(forces)}

    def _references(self, position: ArrayLike, velocity: ArrayLike | None) -> tuple[np.ndarray, np.ndarray]:
        q_ref = array("Rig.run", "position", position, (None, len(self.joints)))
        if len(q_ref) < 2:
            raise ModelError(
                "found one row of position, expected two at least", place="Rig.run", argument="position"
            )
        velocity = np.zeros_like(q_ref) if velocity is None else velocity
        v_ref = array("Rig.run", "velocity", velocity, q_ref.shape)
        return q_ref, v_ref

    def __repr__(self) -> str:
        n = len(self.joints)
        return f"<Rig: {self.robot.name} under {n} servo{'s' * (n > 1)}, every {self.period:g} s>"

    @cached_property
    def _sensed(self) -> tuple[str, ...]:
        return tuple(name for name in ("gained",) if name in self.loop.vectors)

    @cached_property
    def _shown(self) -> tuple[str, ...]:
        known = {*self.robot.variables, *self.robot.vectors}
        wanted = [n for joint in self.joints for n in (*drive(joint), f"{joint.rpartition('.')[0]}.friction")]
        return tuple(name for name in (*wanted, *SHOWN) if name in known)

    def _law(self, joint: str) -> str | None:
        """The friction beside a joint whose level and deflection are drawn, None where there is none."""
        owner = joint.rpartition(".")[0]
        laws = [n.removesuffix(".level") for n in self.robot.inputs if n.startswith(f"{owner}.")]
        for law in laws:
            if f"{law}.z_0" in self.robot.inputs:
                return law
        rubs = [n for n in self.robot.parameters if n.startswith(f"{owner}.") and n.endswith(".f_c")]
        if rubs and (self.noise.level or self.noise.rest):
            raise ModelError(
                f"Rig: found friction {rubs[0].removesuffix('.f_c')} without the inputs level and z_0, expected such as "
                "PreslidingFriction; or Scatter(level=0.0, rest=0.0), which draws noise alone"
            )
        return None

    def _at_rest(self, q: np.ndarray) -> tuple[Dae, np.ndarray]:
        """The loop that starts from rest with its joints at q (n,), and the forces (n,) in N that hold it there."""
        key = tuple(q.tolist())
        if key not in self._started:
            laws = [law for law in self._laws if law is not None]
            words = {"level": 1.0, "z_0": 0.0, "moved": 0.0}  # so that no friction helps to hold it
            still = {f"{law}.{word}": value for law in laws for word, value in words.items()}
            at = dict(zip(self.joints, key, strict=True)) | still
            point = linearize(self.robot, at=at, steady=True).point
            starts = {f"robot.{name}": point[name] for name in self.robot.states}
            for k, value in enumerate(key):
                starts |= dict.fromkeys(self.loop.expand(f"controllers[{k}].q_seen"), value)
            forces = np.array([point[drive(joint)[2]] for joint in self.joints])
            while len(self._started) >= KEPT:
                self._started.pop(next(iter(self._started)))  # the oldest
            self._started[key] = self.loop.with_starts(starts), forces
        return self._started[key]

    def _drawn(self, forces: np.ndarray, random: np.random.Generator) -> dict[str, float]:
        """Inputs at the start of a run: friction level, position within the friction band, and holding forces."""
        n = len(self.joints)
        level = 1 + self.noise.level * random.uniform(-1, 1, n)
        rest = self.noise.rest * random.uniform(-1, 1, n)
        inputs = {}
        for k, law in enumerate(self._laws):
            if law is not None:
                values = {word: self.robot.parameter_values[f"{law}.{word}"] for word in ("f_c", "x")}
                inputs[f"robot.{law}.level"] = float(level[k])
                inputs[f"robot.{law}.z_0"] = rest[k] * values["x"]
                forces = forces + np.eye(n)[k] * level[k] * rest[k] * values["f_c"]
        return inputs | {f"controllers[{k}].f_ff": float(force) for k, force in enumerate(forces)}

    def _with_readings(
        self,
        t: np.ndarray,
        values: dict[str, np.ndarray],
        units: dict[str, str],
        sensed: list[np.ndarray],
        forces: np.ndarray,
        random: np.random.Generator,
    ) -> Result:
        true = {"q": np.column_stack([values[joint] for joint in self.joints])}
        place = next((name for name in SEEN if name in self._shown), None)
        if place is not None:
            true["r"] = np.column_stack([values[f"{place}[{k}]"] for k in range(3)])
        if sensed:
            true["a"] = sensed[0]
        true["f"] = forces
        run = Result(t, values, units=units, title=f"{self.robot.name} under its servos")
        return with_readings(run, true, unit_of(self.joints), self.noise, random)
