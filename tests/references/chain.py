"""A serial chain of revolutes in space: composite bodies and Newton-Euler in world axes.

Motions (angular, linear velocity of the point at the world's origin) and forces (moment about the origin, force)
are columns of six, after Featherstone, Rigid Body Dynamics Algorithms (2008), sections 5.3 and 6.2:

    S_i = (z_i, p_i x z_i)        V_i = V_i-1 + S_i w_i        A_i = A_i-1 + S_i w_i' + V_i x S_i w_i
    F_i = I_i A_i + V_i x* I_i V_i        tau_i = S_i . (F_i + ... + F_N)        A_0 = -g
    M_ij = S_i . I^c_max(i, j) S_j        I^c_i = I_i + ... + I_N
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tests.references.rotations import skew, turn


@dataclass(frozen=True)
class Chain:
    """A chain of N bodies; body axes are parallel to the world's at phi = 0, with the origin in the body's joint."""

    axes: np.ndarray  # (N, 3) unit vectors, of the joint towards the body before
    offsets: np.ndarray  # (N, 3) m, joint i in axes of body i - 1 (the world for the first)
    masses: np.ndarray  # (N,) kg
    centres: np.ndarray  # (N, 3) m, centre of mass from the joint
    inertias: np.ndarray  # (N, 3, 3) kg.m2, about the centre of mass
    gravity: np.ndarray  # (3,) m/s2


def random_chain(count: int, seed: int = 0) -> Chain:
    """A chain of general axes, arms and inertias."""
    rng = np.random.default_rng(seed)
    axes = rng.normal(size=(count, 3))
    halves = rng.normal(size=(count, 3, 3)) * 0.2
    return Chain(
        axes=axes / np.linalg.norm(axes, axis=1)[:, None],
        offsets=rng.uniform(-0.5, 0.5, (count, 3)),
        masses=rng.uniform(0.5, 2.0, count),
        centres=rng.uniform(-0.3, 0.3, (count, 3)),
        inertias=halves @ halves.transpose(0, 2, 1) + 0.01 * np.eye(3),
        gravity=np.array([0.0, 0.0, -9.81]),
    )


def poses(chain: Chain, phi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Joint positions (N, 3) in m and rotations from body to world axes, (N, 3, 3); phi (N,) in rad."""
    R, p = np.eye(3), np.zeros(3)
    places, rotations = [], []
    for axis, offset, angle in zip(chain.axes, chain.offsets, phi, strict=True):
        p = p + R @ offset
        R = R @ turn(angle * axis)
        places.append(p)
        rotations.append(R)
    return np.array(places), np.array(rotations)


def screws(chain: Chain, phi: np.ndarray) -> np.ndarray:
    """S_i in rows, (N, 6)."""
    p, R = poses(chain, phi)
    z = np.einsum("nab,nb->na", R, chain.axes)
    return np.hstack([z, np.cross(p, z)])


def spatial_inertias(chain: Chain, phi: np.ndarray) -> np.ndarray:
    """I_i about the world's origin, (N, 6, 6)."""
    p, R = poses(chain, phi)
    result = np.empty((len(phi), 6, 6))
    for i, (m, r, J) in enumerate(zip(chain.masses, chain.centres, chain.inertias, strict=True)):
        c = skew(p[i] + R[i] @ r)
        result[i] = np.block([[R[i] @ J @ R[i].T - m * c @ c, m * c], [-m * c, m * np.eye(3)]])
    return result


def mass_matrix(chain: Chain, phi: np.ndarray) -> np.ndarray:
    """M, (N, N) in kg.m2, by composite bodies."""
    S = screws(chain, phi)
    composite = np.cumsum(spatial_inertias(chain, phi)[::-1], axis=0)[::-1]
    upper = np.triu(np.einsum("ia,jab,jb->ij", S, composite, S))
    return upper + np.triu(upper, 1).T


def inverse_dynamics(chain: Chain, phi: np.ndarray, w: np.ndarray, w_dot: np.ndarray) -> np.ndarray:
    """Joint torques of a motion, (N,) in N.m, by Newton and Euler; w (N,) in rad/s, w_dot (N,) in rad/s2."""
    V, A = np.zeros(6), np.concatenate([np.zeros(3), -chain.gravity])
    S = screws(chain, phi)
    forces = []
    for i, inertia in enumerate(spatial_inertias(chain, phi)):
        V = V + S[i] * w[i]
        A = A + S[i] * w_dot[i] + motion_cross(V) @ S[i] * w[i]
        forces.append(inertia @ A - motion_cross(V).T @ inertia @ V)
    onward = np.cumsum(np.array(forces)[::-1], axis=0)[::-1]
    return np.einsum("ia,ia->i", S, onward)


def motion_cross(V: np.ndarray) -> np.ndarray:
    """The rate of a motion that is carried along by V, (6, 6); of a force, minus its transpose."""
    return np.block([[skew(V[:3]), np.zeros((3, 3))], [skew(V[3:]), skew(V[:3])]])


def forward_dynamics(chain: Chain, phi: np.ndarray, w: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Joint accelerations under joint torques tau (N.m), (N,) in rad/s2."""
    bias = inverse_dynamics(chain, phi, w, np.zeros(len(phi)))
    return np.linalg.solve(mass_matrix(chain, phi), tau - bias)


def energy(chain: Chain, phi: np.ndarray, w: np.ndarray) -> float:
    """Kinetic and potential energy, J."""
    p, R = poses(chain, phi)
    centres = p + np.einsum("nab,nb->na", R, chain.centres)
    return float(w @ mass_matrix(chain, phi) @ w / 2 - chain.masses @ (centres @ chain.gravity))
