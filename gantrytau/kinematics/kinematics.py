"""Forward and inverse kinematics of a robot by name, for one pose or many.

    kinematics = Kinematics(GantryTau(prototypes.L1))
    q = kinematics.ik([[0.5, 3.0, -0.6], [0.6, 3.0, -0.6]])          # (2, 3), NaN rows out of reach
    r, R = kinematics.fk(q)

Robots on rods say what they are made of, as `rods()` of a Gantry-Tau does; a closed form is taken only if the start of the
model, which its equations decide, fits its links. Any other model answers through its equations.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gantrytau.border.checks import number
from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.compiler.parameters import parameter_table, with_values
from gantrytau.dae import Dae, translate
from gantrytau.describing.record import Record
from gantrytau.kinematics.arm_functions import ArmFunctions
from gantrytau.kinematics.model_functions import ModelFunctions, home_of, limits_of
from gantrytau.kinematics.poses import answered, mounting_axes, poses, vectors
from gantrytau.kinematics.rods.configurations import Configuration, of_joints, of_pose, of_signs
from gantrytau.kinematics.rods.rod_geometry import geometry_of
from gantrytau.kinematics.rods.rod_robots import Home, RodRobot, SixRods, TurningRods, robot_on
from gantrytau.kinematics.rotations import angle_between
from gantrytau.language.model import Model

FITS = 1e-6  # m by which links may miss their lengths at the start of a model


class Kinematics(Record):
    """Kinematics of a robot: a model instance, or what `translate` made of one.

    tool: name of the component with the pose `.r` (and `.R`). joints: names of the actuator coordinates, by default the `s`
    or `phi` beside each driving force or torque, lengths first. tolerance: of poses, m: greatest error of a link length
    where ik of a robot with three carts is given an orientation too, and greatest distance of a pose from the possible
    poses of a robot with fewer than six joints.

    Poses are r (N, 3) in m and R (N, 3, 3) from plate to world, or one pose without the first axis; q is (N, n) in m and
    rad. Rows without a solution, or with a NaN argument, are NaN. Raises ModelError for arrays of other shapes and
    models without tool or drives.
    """

    def __init__(
        self,
        robot: Model | Dae,
        *,
        tool: str = "tool",
        joints: Sequence[str] | None = None,
        tolerance: float = 1e-6,
    ):
        self._tolerance = number("Kinematics", "tolerance", tolerance, unit="m", least=0.0)
        self.dae = robot if isinstance(robot, Dae) else translate(robot, units=False)
        self._tool = tool
        joints = None if joints is None else (joints,) if isinstance(joints, str) else tuple(joints)
        self._values = dict(self.dae.parameter_values)
        if f"{tool}.r" not in self.dae.vectors:
            raise ModelError(
                f"Kinematics: {self.dae.name} has no '{tool}.r', expected the position of a tool"
                f"{did_you_mean(f'{tool}.r', self.dae.vectors)} Name its component by tool="
            )
        self._solver: Any = self._recognised(joints) or self._by_equations(joints)
        self.iterations_by_pose: np.ndarray = np.zeros(0, dtype=int)

    def __repr__(self) -> str:
        return f"<Kinematics of {self.dae.name}: {', '.join(self.joints)} and {self._tool}>"

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the actuator coordinates, the columns of q."""
        return self._solver.joints

    @property
    def home(self) -> Home:
        """Start pose of the model, with `.q .r .R`; it decides the branch."""
        return self._solver.home

    @property
    def iterations(self) -> int:
        """Greatest number of Newton iterations of any pose in the last call; `iterations_by_pose` has them pose by pose."""
        return int(self.iterations_by_pose.max(initial=0))

    @property
    def limits(self) -> np.ndarray:
        """Bounds that the model declares for its actuator coordinates, (n, 2); infinite where it declares none."""
        return limits_of(self.dae, self.joints)

    def ik(self, r: Any, R: Any = None) -> np.ndarray:
        """Actuator coordinates q (N, n) of poses; (n,) for one.

        Without R the orientation is that given by the links; the F1 needs one. Poses with a link too short, or with an
        orientation impossible for three carts, are NaN rows.
        """
        at = poses(r, R, "Kinematics.ik")
        q, self.iterations_by_pose = self._solver.ik(at.r, at.R)
        return answered(at.one, q)[0]

    def within_a_turn(self, q: np.ndarray, limits: np.ndarray) -> np.ndarray:
        """Coordinates (N, n) with whole turns added to angles, which then are nearest to the middle of limits (n, 2)."""
        return self._solver.within_a_turn(q, limits) if isinstance(self._solver, ModelFunctions) else q

    def fk(self, q: Any, near: Any = None) -> tuple[np.ndarray, np.ndarray]:
        """Poses r (N, 3), R (N, 3, 3) of actuator coordinates; (3,) and (3, 3) for one.

        near: a position r, or (r, R). It chooses the branch of a robot with three links; for others it is the first iterate,
        and any pose found is returned for which ik gives q. By default poses are on the branch of the start of the model,
        NaN where this branch has none: tool on the other side of the carts, or links that cross.
        """
        q, one = vectors(q, len(self.joints), "q", "Kinematics.fk")
        if near is not None:
            near = self._near(near, len(q))
        r, R, self.iterations_by_pose = self._solver.fk(q, near)
        r, R = answered(one, r, R)
        return r, R

    def jacobian(self, r: Any, R: Any = None) -> np.ndarray:
        """dq/dpose of poses, (N, n, 3) by r, or (N, n, 6) by r and a rotation vector resolved in the world.

        Three columns where the orientation follows from r (three carts, no R given), six with R.
        """
        at = poses(r, R, "Kinematics.jacobian")
        return answered(at.one, self._solver.jacobian(at.r, at.R))[0]

    def rates(self, r: Any, R: Any = None) -> np.ndarray:
        """Jacobian from joint rates to tool velocity, (N, 3, n), or with R to velocity and angular velocity, (N, 6, n).

        Velocities are resolved in the world. Infinite or NaN in singular poses and out of reach.
        """
        at = poses(r, R, "Kinematics.rates")
        return answered(at.one, self._solver.rates(at.r, at.R))[0]

    def variables(self, names: str | Sequence[str], r: Any, R: Any = None) -> list[np.ndarray]:
        """Values of other variables of the model in poses, such as angles of passive joints, (N, k) each; (k,) for one pose.

        Raises ModelError for robots computed by their rods, which have `ball_joint_angles` instead.
        """
        at = poses(r, R, "Kinematics.variables")
        if not isinstance(self._solver, ModelFunctions):
            raise ModelError(
                f"Kinematics.variables: found {self.dae.name}, which answers by its rods alone, expected a robot "
                "through its equations; use ball_joint_angles, or dae.array_function"
            )
        wanted = (names,) if isinstance(names, str) else tuple(names)
        return list(answered(at.one, *self._solver.variables(wanted, at.r, at.R))) if wanted else []

    def orientation(self, r: Any) -> np.ndarray:
        """The orientation that follows from positions, (N, 3, 3), of a robot whose joints do not choose it."""
        at = poses(r, None, "Kinematics.orientation")
        if not isinstance(self._solver, ModelFunctions):
            return answered(at.one, self.fk(self.ik(at.r))[1])[0]
        return answered(at.one, self._solver.whole_pose(at.r)[1])[0]

    @property
    def through_equations(self) -> bool:
        """Whether poses are found by the equations of the model, as for a robot without `rods()`."""
        return isinstance(self._solver, ModelFunctions)

    @property
    def turning(self) -> bool:
        """Whether the joints also choose the orientation of the tool, so that ik needs one."""
        return self._solver.turning if isinstance(self._solver, ModelFunctions) else len(self.joints) > 3

    def ik_of_five_degrees(self, r: Any, R: Any) -> np.ndarray:
        """Coordinates q (N, 6) of the F1 as if the links of an arm were parallel and of one length (4.25).

        A turntable takes the angle nearest to R, and carts out of reach are nearest to it: ik starts here.
        """
        robot = self._with_turntables("ik_of_five_degrees")
        at = poses(r, R, "Kinematics.ik_of_five_degrees")
        if at.R is None:
            raise ModelError("Kinematics.ik_of_five_degrees: found no orientation R, expected one; give R")
        return answered(at.one, robot.five_degrees(at.r, at.R, robot.sides))[0]

    def fk_of_five_degrees(self, q: Any) -> tuple[np.ndarray, np.ndarray]:
        """Poses r (N, 3), R (N, 3, 3) of the F1 with each arm as one link, its joints parallel to the plate's (4.26)."""
        robot = self._with_turntables("fk_of_five_degrees")
        q, one = vectors(q, 6, "q", "Kinematics.fk_of_five_degrees")
        r, R = answered(one, *robot.pose_of_five_degrees(q))
        return r, R

    def configurations(self, *, q: Any = None, r: Any = None, R: Any = None) -> list[Configuration]:
        """All solutions, forward of q or inverse of r (and R), each with `.q .r .R .feasible`.

        Three links: two poses of q, eight q of a pose, for many at once. Six links: one pose at a time; all real
        assembly modes of q, or the q of a pose with every arm on either side of its cart. Any other robot: the q of one pose
        from many starts, with names such as "+-": one sign for each loop, of a serial arm one for each joint with singular
        values and one for the rest; "+" is the sign at home. Raises ModelError unless exactly one of q and r is given.
        """
        if (q is None) == (r is None):
            raise ModelError(
                f"Kinematics.configurations: found {'neither' if q is None else 'both'} of q and r, expected one of them; "
                "give q= for poses, r= (and R=) for actuator coordinates"
            )
        if isinstance(self._solver, ModelFunctions) and q is None:
            at = poses(r, R, "Kinematics.configurations")
            joints, signs = self._solver.solutions(at.r[:1], None if at.R is None else at.R[:1])
            return of_signs(at, self.within_a_turn(joints, self.limits), signs, self.limits)
        robot = self.linked("configurations")
        if q is not None:
            joints, one = vectors(q, len(self.joints), "q", "Kinematics.configurations")
            return of_joints(robot, joints, one, self.limits)
        return of_pose(robot, poses(r, R, "Kinematics.configurations"), self.limits)

    def state(self, r: Any, R: Any = None, q: Any = None) -> np.ndarray:
        """Configuration state of poses, (N, 4).

        For each arm 1 if it points along its guideway, -1 against it, 0 in a singular pose; last, 1 if the tool is
        ahead of the plane of the carts, -1 if behind. q: coordinates of the pose, by default those of ik.
        """
        robot = self.linked("state")
        at, q, R = self._whole(robot, r, R, q, "Kinematics.state")
        found = np.column_stack([robot.sides_of(q, at.r, R), robot.ahead_of(q, at.r, R)])
        return answered(at.one, found)[0]

    def ball_joint_angles(
        self, r: Any, R: Any = None, q: Any = None, *, cart_axes: Any = None, plate_axes: Any = None
    ) -> np.ndarray:
        """Angles between links and the axes of their ball joints, (N, links, 2) in rad: on the cart, on the plate.

        cart_axes (links, 3), in axes of the cart or of the turntable on it; plate_axes (links, 3), in plate axes; both
        point as the link does, from cart to plate. By default a joint is mounted along its link in the home pose.
        """
        robot = self.linked("ball_joint_angles")
        at, q, R = self._whole(robot, r, R, q, "Kinematics.ball_joint_angles")
        default = robot.geometry.link_directions(robot.home.q[None], robot.home.r[None], robot.home.R[None])
        shape, place = (len(robot.geometry.length), 3), "Kinematics.ball_joint_angles"
        given = {"cart_axes": cart_axes, "plate_axes": plate_axes}
        axes = [
            along[0] if found is None else mounting_axes(place, name, found, shape)
            for (name, found), along in zip(given.items(), default, strict=True)
        ]
        links = robot.geometry.link_directions(q, at.r, R)
        found = np.stack([angle_between(link, axis) for link, axis in zip(links, axes, strict=True)], axis=2)
        return answered(at.one, found)[0]

    def replaced(self, parameters: Mapping[str, Any]) -> "Kinematics":
        """The robot with other values of parameters such as `arms[0].length`, on the same branch.

        Raises ModelError for unknown names or shapes. Quick for Gantry-Tau robots, whose model is not translated anew.
        """
        robot = self.linked("replaced")
        flat = with_values(self.dae.flat, parameters)
        found = Kinematics.__new__(Kinematics)
        found.__dict__.update(self.__dict__)
        found._values = dict(parameter_table(flat).values)
        assert flat.rods is not None  # of a robot on rods
        geometry = geometry_of(flat.rods, found._values)
        found._solver = type(robot)(geometry, robot.home, robot.tolerance)
        # what decides the branch is taken over, as the old home is no pose of the new robot
        found._solver.__dict__.update(sides=robot.sides, ahead=robot.ahead)
        found.iterations_by_pose = np.zeros(0, dtype=int)
        return found

    def linked(self, what: str = "links") -> RodRobot:
        """The robot as guideways and links; ModelError for a model of other parts."""
        if isinstance(self._solver, RodRobot):
            return self._solver
        raise ModelError(
            f"Kinematics.{what}: found {self.dae.name}, expected a Gantry-Tau robot, or another that says by rods() "
            "what its links are; use ik, fk and jacobian, or start values of another branch"
        )

    def _with_turntables(self, what: str) -> TurningRods:
        if isinstance(self._solver, TurningRods):
            return self._solver
        raise ModelError(
            f"Kinematics.{what}: found {self.dae.name}, expected a robot with turntables such as "
            "F1GantryTau(prototypes.F1); use ik and fk"
        )

    def _whole(self, robot: RodRobot, r: Any, R: Any, q: Any, place: str):
        """Poses with the q and R that follow where they are not given."""
        at = poses(r, R, place)
        if q is None:
            q, self.iterations_by_pose = robot.ik(at.r, at.R)
        else:
            q, _ = vectors(q, len(self.joints), "q", place)
            if len(q) != len(at.r):
                raise ModelError(
                    f"{place}: found q of {len(q)} rows for {len(at.r)} poses, expected one a pose; leave q out where it "
                    "follows from the pose"
                )
        if at.R is not None:
            return at, q, at.R
        following = isinstance(robot, SixRods)
        return at, q, robot.follow(at.r, robot.sides)[1] if following else robot.repeated(len(at.r))

    def _near(self, near: Any, count: int) -> tuple[np.ndarray, np.ndarray]:
        r, R = near if isinstance(near, tuple) and len(near) == 2 else (near, None)
        at = poses(r, R, "Kinematics.fk, near")
        if len(at.r) not in (1, count):
            raise ModelError(
                f"Kinematics.fk: found near of {len(at.r)} rows, expected 1 or {count}, as q has; give one for each pose"
            )
        R = self.home.R if at.R is None else at.R
        return np.broadcast_to(at.r, (count, 3)), np.broadcast_to(R, (count, 3, 3))

    def _recognised(self, joints: Sequence[str] | None) -> RodRobot | None:
        """The robot as guideways and links, if it says that it is one and its start fits them."""
        rods = self.dae.flat.rods
        if rods is None or self._tool != "tool" or joints not in (None, rods.joints):
            return None
        rods.check(self.dae.name, (*self.dae.variables, *self.dae.vectors, *self._values))
        geometry = geometry_of(rods, self._values)
        home = home_of(self.dae.evaluate(), self._tool, geometry.names)
        length = geometry.slopes(home.q[None], home.r[None], home.R[None])[0]
        fits = np.abs(length - geometry.length).max() < FITS
        return robot_on(geometry, home, self._tolerance) if fits else None

    def _by_equations(self, joints: Sequence[str] | None) -> ModelFunctions:
        names = tuple(joints) if joints is not None else driven_joints(self.dae)
        names = tuple(scalar for name in names for scalar in self.dae.expand(name))
        robot = (
            self.dae,
            self._tool,
            names,
            home_of(self.dae.evaluate(), self._tool, names),
            self._tolerance,
        )
        arm = ArmFunctions(*robot)
        return arm if arm.in_a_row else ModelFunctions(*robot)


def driven_joints(dae: Dae) -> tuple[str, ...]:
    """Coordinates that the inputs of a model drive: `x.s` beside a force `x.f`, `x.phi` beside a torque `x.tau`."""
    known = set(dae.variables)
    pairs = [(name.rpartition(".")[0], name.rpartition(".")[2]) for name in dae.inputs]
    lengths = [f"{owner}.s" for owner, last in pairs if last == "f" and f"{owner}.s" in known]
    angles = [f"{owner}.phi" for owner, last in pairs if last == "tau" and f"{owner}.phi" in known]
    if not lengths and not angles:
        raise ModelError(
            f"Kinematics: {dae.name} has the inputs {', '.join(dae.inputs) or 'none'}, expected forces x.f beside x.s or "
            "torques x.tau beside x.phi, where x is a component; name the actuator coordinates by joints="
        )
    return (*lengths, *angles)
