"""The six-link Gantry-Tau and serial chains in Pinocchio, whose algorithms are the peer for speed.

The robot as its user has to write it there: a tree of the plate (free flyer), three carts on rails, and each link as
a body of its own on a universal joint at the cart, closed to the plate by a 3D contact. 21 speeds and 18 constraints
instead of 9 and 6. Universal joints, because a link that can spin about itself needs an inertia to resist it. Links
without mass cannot be written.

Pinocchio (PyPI: pin) is imported where it is needed only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.references import six_link
from tests.references.chain import Chain
from tests.references.six_link import ARMS, SixLink, State

# The plate's six speeds come first, then each cart's with two for each of its links.
CARTS = np.array([6, 9, 14])
LINKS = np.setdiff1d(np.arange(6, 21), CARTS)


@dataclass(frozen=True)
class Mechanism:
    """A mechanism of Pinocchio, ready to be asked."""

    model: Any
    data: Any
    contacts: Any
    contact_data: Any
    settings: Any


def pinocchio() -> Any:
    """The module; its types are not known to the checker."""
    import pinocchio as pin  # pyright: ignore[reportMissingImports]

    return pin


def six_link_mechanism(robot: SixLink) -> Mechanism:
    """The robot with heavy links; q in m along the unit vector of its guideway, links start along e_x.

    Raises ValueError for links without mass.
    """
    if not np.all(robot.link_masses > 0):
        raise ValueError(
            f"six_link_mechanism: link_masses = {robot.link_masses} kg, expected above zero, because "
            "each link is a body with speeds of its own; give it a small mass"
        )
    pin = pinocchio()
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -robot.g])
    plate = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "plate")
    model.appendBodyToJoint(
        plate, pin.Inertia(robot.plate_mass, np.zeros(3), robot.plate_inertia), pin.SE3.Identity()
    )
    contacts = pin.StdVec_RigidConstraintModel()
    for i, v in enumerate(robot.directions):  # depth first, as Pinocchio silently requires
        rail = pin.JointModelPrismaticUnaligned(v / np.linalg.norm(v))
        cart = model.addJoint(0, rail, pin.SE3.Identity(), f"cart{i}")
        point = pin.Inertia(robot.cart_masses[i], np.zeros(3), np.zeros((3, 3)))
        model.appendBodyToJoint(cart, point, pin.SE3.Identity())
        for k in np.flatnonzero(i == ARMS):
            contacts.append(link_with_contact(pin, model, robot, int(k), cart, plate))
    data, contact_data = model.createData(), pin.StdVec_RigidConstraintData()
    for contact in contacts:
        contact_data.append(contact.createData())
    pin.initConstraintDynamics(model, data, contacts, contact_data)
    return Mechanism(model, data, contacts, contact_data, pin.ProximalSettings(1e-14, 0.0, 1))


def link_with_contact(pin: Any, model: Any, robot: SixLink, k: int, cart: int, plate: int) -> Any:
    """Adds link k to its cart; the contact that joins its end to the plate."""
    joint = pin.JointModelUniversal(np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]))
    link = model.addJoint(cart, joint, at(pin, robot.cart_joints[k]), f"link{k}")
    end = np.array([robot.lengths[k], 0.0, 0.0])
    point = pin.Inertia(robot.link_masses[k], end / 2, np.zeros((3, 3)))
    model.appendBodyToJoint(link, point, pin.SE3.Identity())
    places = (link, at(pin, end), plate, at(pin, robot.plate_joints[k]))
    return pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, model, *places, pin.ReferenceFrame.LOCAL)


def at(pin: Any, place: np.ndarray) -> Any:
    """A placement without rotation."""
    return pin.SE3(np.eye(3), place)


def six_link_arguments(
    robot: SixLink, state: State, f: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Configuration, speeds (21,) and joint forces (21,) of Pinocchio; f (3,) in N conjugate to q."""
    pin = pinocchio()
    speed = np.linalg.norm(robot.directions, axis=1)
    d = six_link.link_vectors(robot, state.T, state.R, state.q)
    d_dot = state.T_dot + np.cross(state.w, robot.plate_joints @ state.R.T)
    d_dot -= (state.q_dot[:, None] * robot.directions)[ARMS]
    # links along R_y(a) R_z(b) e_x = (cos b cos a, sin b, -cos b sin a)
    e, e_dot = d / robot.lengths[:, None], d_dot / robot.lengths[:, None]
    a, b = np.arctan2(-e[:, 2], e[:, 0]), np.arcsin(e[:, 1])
    b_dot = e_dot[:, 1] / np.cos(b)
    a_dot = -(np.sin(a) * e_dot[:, 0] + np.cos(a) * e_dot[:, 2]) / np.cos(b)
    # the speeds of a free flyer are resolved in its own axes; its configuration has one number more, a quaternion
    v, tau = np.zeros(21), np.zeros(21)
    v[:6] = np.concatenate([state.R.T @ state.T_dot, state.R.T @ state.w])
    v[CARTS], v[LINKS] = state.q_dot * speed, np.column_stack([a_dot, b_dot]).ravel()
    q = np.concatenate([state.T, pin.Quaternion(state.R).coeffs(), np.zeros(15)])
    q[1 + CARTS], q[1 + LINKS] = state.q * speed, np.column_stack([a, b]).ravel()
    tau[CARTS] = f / speed
    return q, v, tau


def forward_dynamics(robot: SixLink, state: State, f: np.ndarray) -> Callable[[], np.ndarray]:
    """What is to be timed: the constrained forward dynamics at one state, all of it done again at each call."""
    pin = pinocchio()
    mechanism = six_link_mechanism(robot)
    q, v, tau = six_link_arguments(robot, state, f)
    model, data, contacts = mechanism.model, mechanism.data, mechanism.contacts
    contact_data, settings = mechanism.contact_data, mechanism.settings
    return lambda: pin.constraintDynamics(model, data, q, v, tau, contacts, contact_data, settings)


def accelerations(robot: SixLink, state: State, f: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """T'' (3,) in m/s2, w' (3,) in rad/s2 in world axes, q'' (3,) in m/s2."""
    found = np.array(forward_dynamics(robot, state, f)())
    linear, angular = state.R @ found[:3], state.R @ found[3:6]
    # d/dt of R v is R (v' + w x v): the acceleration of a free flyer is a spatial one
    speed = np.linalg.norm(robot.directions, axis=1)
    return linear + np.cross(state.w, state.T_dot), angular, found[CARTS] / speed


def chain_model(chain: Chain) -> Any:
    """A serial chain of revolutes as a model of Pinocchio."""
    pin = pinocchio()
    model = pin.Model()
    model.gravity.linear = np.array(chain.gravity)
    joint = 0
    for i, axis in enumerate(chain.axes):
        joint = model.addJoint(
            joint, pin.JointModelRevoluteUnaligned(axis), at(pin, chain.offsets[i]), f"joint{i}"
        )
        body = pin.Inertia(chain.masses[i], chain.centres[i], chain.inertias[i])
        model.appendBodyToJoint(joint, body, pin.SE3.Identity())
    return model


def chain_forward_dynamics(
    chain: Chain, phi: np.ndarray, w: np.ndarray, tau: np.ndarray
) -> Callable[[], np.ndarray]:
    """Joint accelerations by the articulated body algorithm, (N,) in rad/s2, as a callable to be timed."""
    pin = pinocchio()
    model = chain_model(chain)
    data = model.createData()
    return lambda: pin.aba(model, data, phi, w, tau)
