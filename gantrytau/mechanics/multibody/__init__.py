"""Bodies and joints in space.

| quantity | meaning | resolved in |
|---|---|---|
| frame.r | position of the frame's origin, m | world |
| frame.R | orientation: columns are the frame's axes, world = R @ local | - |
| frame.w | angular velocity, rad/s | world |
| frame.f | cut force, positive into the component, N | world |
| frame.t | cut torque about the frame's origin, positive into the component, N.m | world |
| s, v, f | coordinate, speed and driving force of a prismatic or cylindrical joint | its axis |
| phi, w, tau | angle, angular velocity and driving torque of a revolute or cylindrical joint about n | its axis |
| q | unit quaternion (scalar first) of a free body or a spherical joint, R = R(q) | - |
| n, r, r_cm, J | axes, offsets and inertia that belong to a component | its frame_a |

frame_a is the side towards the base, frame_b the other. A joint moves frame_b against frame_a by its
coordinate and does not mind which of the two is nearer to the world. Its flange `axis` is driven against
`support`, which is fixed to frame_a; both may stay unconnected, which means no force.
"""

from gantrytau.mechanics.multibody.bodies import Body, PointMass
from gantrytau.mechanics.multibody.bushing import Bushing
from gantrytau.mechanics.multibody.contact import (
    ContactLaw,
    HuntCrossley,
    LinearContact,
    PegContact,
    SurfaceContact,
)
from gantrytau.mechanics.multibody.elastic_peg import ElasticPegContact
from gantrytau.mechanics.multibody.forces import FrameForce, FrameTorque, LineForce, WorldForce, WorldTorque
from gantrytau.mechanics.multibody.frames import (
    Fixed,
    FixedRotation,
    FixedTranslation,
    Frame,
    TwoFrames,
    World,
)
from gantrytau.mechanics.multibody.inertia_file import Inertias, read_inertias
from gantrytau.mechanics.multibody.joints import (
    Cylindrical,
    Prismatic,
    Revolute,
    Spherical,
    SphericalSpherical,
    Universal,
)
from gantrytau.mechanics.multibody.sensors import CutSensor, PoseSensor, RelativeSensor

__all__ = [
    "Body",
    "Bushing",
    "ContactLaw",
    "CutSensor",
    "Cylindrical",
    "ElasticPegContact",
    "Fixed",
    "FixedRotation",
    "FixedTranslation",
    "Frame",
    "FrameForce",
    "FrameTorque",
    "HuntCrossley",
    "Inertias",
    "LineForce",
    "LinearContact",
    "PegContact",
    "PointMass",
    "PoseSensor",
    "Prismatic",
    "RelativeSensor",
    "Revolute",
    "Spherical",
    "SphericalSpherical",
    "SurfaceContact",
    "TwoFrames",
    "Universal",
    "World",
    "WorldForce",
    "WorldTorque",
    "read_inertias",
]
