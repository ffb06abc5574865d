"""The IFToMM mechanisms in exudyn, as its user writes them: bodies with redundant coordinates, joints, generalized alpha.

Andrews' squeezer stands beside other solvers among the initial values.
"""

import math
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from tests.classics.mechanisms import bar

FIRST, FINER = 100, 4  # steps a second at first, and how many times as many in the next run
LONGEST = 60.0  # s of the last run
Place = Sequence[float] | np.ndarray
Part = tuple[int, Place]  # a body and a point of it, from its centre of mass
STILL = (0.0, 0.0, 0.0)


class Mechanism:
    """Bodies and joints of a system of exudyn."""

    def __init__(self, mbs: Any, exu: Any, gravity: Place):
        self.mbs, self.exu, self.gravity = mbs, exu, list(gravity)
        self.ground = mbs.AddObject(exu.itemInterface.ObjectGround())

    def add(
        self, kind: str, parts: Sequence[Part], marker: str = "MarkerBodyPosition", **settings: Any
    ) -> None:
        """A joint or force between points of two bodies."""
        items = self.exu.itemInterface
        markers = [
            self.mbs.AddMarker(getattr(items, marker)(bodyNumber=body, localPosition=place))
            for body, place in parts
        ]
        self.mbs.AddObject(getattr(items, kind)(markerNumbers=markers, **settings))

    def flat(self, m: float, J: float, at: Place, phi: float, v: float, w: float) -> int:
        """A body in the plane, turned by phi; it moves along x."""
        items = self.exu.itemInterface
        start = dict(referenceCoordinates=[*at, phi], initialVelocities=[v, 0.0, w])
        node = self.mbs.AddNode(items.NodeRigidBody2D(**start))
        centre = self.mbs.AddMarker(items.MarkerNodePosition(nodeNumber=node))
        self.mbs.AddLoad(items.Force(markerNumber=centre, loadVector=[m * g for g in self.gravity]))
        return self.mbs.AddObject(items.ObjectRigidBody2D(mass=m, inertia=J, nodeNumber=node))

    def body(self, m: float, J: Any, at: Place, R: Any = None, w: Place = STILL) -> int:
        """A body in space, turned by R; it turns about the origin."""
        return self.mbs.CreateRigidBody(
            referencePosition=list(at),
            referenceRotationMatrix=np.eye(3) if R is None else R,
            initialVelocity=np.cross(w, at),
            initialAngularVelocity=list(w),
            inertia=self.exu.utilities.RigidBodyInertia(mass=m, inertiaTensor=np.array(J)),
            gravity=self.gravity,
            nodeType=self.exu.NodeType.RotationEulerParameters,
        )

    def joint(self, one: Part, other: Part, axis: int, turns: bool = True) -> None:
        """A hinge about, or with turns=False a slide along, an axis of both bodies at their start."""
        R = np.eye(3)[:, [(axis + 1) % 3, (axis + 2) % 3, axis]]
        held = [1, 1, 1, 1, 1, 0] if turns else [1, 1, 0, 1, 1, 1]
        frames = dict(rotationMarker0=R, rotationMarker1=R)
        self.add("GenericJoint", (one, other), "MarkerBodyRigid", constrainedAxes=held, **frames)


def pendulum(mbs: Any, exu: Any) -> Part:
    """A01, a point at a distance."""
    all_ = Mechanism(mbs, exu, (0.0, -9.81, 0.0))
    ball = all_.flat(1.0, 1.0, (1.0, 0.0), 0.0, 0.0, 0.0)
    all_.add("DistanceConstraint", ((all_.ground, STILL), (ball, STILL)), distance=1.0)
    return ball, STILL


def windows(mbs: Any, exu: Any) -> Part:
    """A02, 40 windows."""
    all_, low, high = Mechanism(mbs, exu, (0.0, -9.81, 0.0)), (-0.5, 0.0, 0.0), (0.5, 0.0, 0.0)
    uprights = [all_.flat(1.0, 1 / 12, (k, 0.5), math.pi / 2, 0.5, -1.0) for k in range(41)]
    for k, upright in enumerate(uprights):
        all_.add("RevoluteJoint2D", ((all_.ground, (k, 0.0, 0.0)), (upright, low)))
    for k in range(40):
        coupler = all_.flat(1.0, 1 / 12, (k + 0.5, 1.0), 0.0, 1.0, 0.0)
        all_.add("RevoluteJoint2D", ((uprights[k], high), (coupler, low)))
        all_.add("RevoluteJoint2D", ((coupler, high), (uprights[k + 1], high)))
    return uprights[0], high


def bricard(mbs: Any, exu: Any) -> Part:
    """A04, whose constraints repeat each other."""
    all_ = Mechanism(mbs, exu, (0.0, -9.81, 0.0))
    last, corner, rods = (all_.ground, STILL), np.zeros(3), []
    for axis, way in zip(
        (1, 2, 0, 1, 2), np.array([[1, 0, 0], [0, -1, 0], [0, 0, 1], [-1, 0, 0], [0, 1, 0]]), strict=True
    ):
        rods.append(all_.body(1.0, bar(way.tolist(), 0.1)["J"], corner + way / 2))
        all_.joint(last, (rods[-1], -way / 2), axis)
        last, corner = (rods[-1], way / 2), corner + way
    all_.joint(last, (all_.ground, corner), 0)
    return rods[2], (0.0, 0.0, 0.5)


def governor(mbs: Any, exu: Any) -> Part:
    """A05, each ball fixed to the end of its arm."""
    all_, w = Mechanism(mbs, exu, (0.0, 0.0, -9.81)), (0.0, 0.0, 2 * math.pi)
    shaft = all_.body(0.3, bar([0.0, 0.0, 1.0], 0.01, 0.3)["J"], (0.0, 0.0, 0.5), w=w)
    slider = all_.body(3.0, np.diag([0.005] * 3), (0.0, 0.0, 0.5), w=w)
    all_.joint((all_.ground, STILL), (shaft, (0.0, 0.0, -0.5)), 2)
    all_.joint((shaft, STILL), (slider, STILL), 2, turns=False)
    for side in (1.0, -1.0):
        R = exu.utilities.RotationMatrixY(-side * math.pi / 3)
        hip = np.array([0.05 * side, 0.0, 1.0])
        arm = all_.body(0.3, np.diag([0.0250025, 0.0250025, 5e-6]), hip + R @ [0.0, 0.0, -0.5], R, w)
        # a bare point of mass: a body whose own inertia is small beside that of its place
        ball = all_.body(5.0, 1e-9 * np.eye(3), hip + R @ [0.0, 0.0, -1.0], R, w)
        all_.add(
            "GenericJoint",
            ((arm, (0.0, 0.0, -0.5)), (ball, STILL)),
            "MarkerBodyRigid",
            constrainedAxes=[1] * 6,
        )
        all_.joint((shaft, (0.05 * side, 0.0, 0.5)), (arm, (0.0, 0.0, 0.5)), 1)
        ends = ((slider, (0.05 * side, 0.0, 0.0)), (arm, STILL))
        all_.add("SpringDamper", ends, stiffness=8e5, damping=4e4, referenceLength=0.5)
    return slider, STILL


WRITTEN: Mapping[str, Callable[[Any, Any], Part]] = {
    "SimplePendulum": pendulum, "NFourBar": windows, "Bricard": bricard, "FlyballGovernor": governor
}  # fmt: skip


def by_exudyn(
    name: str, stop: float, allowed: float, error: Callable[[np.ndarray, np.ndarray], float]
) -> str:
    """Error and processor time of the first run, each of finer steps, with the error allowed; else of the last in time.

    error: of times (n,) and places (n, 3).
    """
    try:
        import exudyn as exu  # pyright: ignore[reportMissingImports]
        import exudyn.itemInterface  # pyright: ignore[reportMissingImports]
        import exudyn.utilities  # pyright: ignore[reportMissingImports]
    except ModuleNotFoundError:
        return ""
    if name not in WRITTEN:
        return ""
    steps, found, spent = round(FIRST * stop), "", 0.0
    while FINER * spent < LONGEST:
        begin = time.process_time()
        places = _motion(exu, WRITTEN[name], stop, steps)
        spent = time.process_time() - begin
        off = error(places[:, 0], places[:, 1:4])
        found = f"{off:.1e} in {spent:.2g} s"
        if off <= allowed:
            break
        steps *= FINER
    return found


def _motion(exu: Any, build: Callable[[Any, Any], Part], stop: float, steps: int) -> np.ndarray:
    """Time and place (n, 4)."""
    mbs = exu.SystemContainer().AddSystem()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of names that exudyn gives up
        body, place = build(mbs, exu)
        sensor = mbs.AddSensor(
            exu.itemInterface.SensorBody(
                bodyNumber=body,
                localPosition=place,
                storeInternal=True,
                outputVariableType=exu.OutputVariableType.Position,
            )
        )
        mbs.Assemble()
        settings = exu.SimulationSettings()
        settings.timeIntegration.numberOfSteps, settings.timeIntegration.endTime = steps, stop
        settings.timeIntegration.verboseMode = 0
        settings.timeIntegration.generalizedAlpha.spectralRadius = 0.9
        settings.timeIntegration.newton.useModifiedNewton = True
        settings.solution.file.write = False
        settings.solution.sensors.writePeriod = stop / 200
        settings.linearSolverType = exu.LinearSolverType.EigenSparse
        if build is bricard:
            settings.linearSolverType = exu.LinearSolverType.EigenDense
            settings.linearSolverSettings.ignoreSingularJacobian = True
        mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.GeneralizedAlpha)
    return np.asarray(mbs.GetSensorStoredData(sensor))
