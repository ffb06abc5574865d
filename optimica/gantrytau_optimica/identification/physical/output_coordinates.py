"""A black box of order 2 n in the coordinates of its outputs and their speeds: the direct route to M, D and K.

T = [C; C A],  T A T^-1 = [[0, 1], [-M^-1 K, -M^-1 D]],  C B = 0,  C A B = M^-1
"""

import numpy as np

from gantrytau import ModelError
from gantrytau.answers.linear_systems.linear_system import LinearSystem
from gantrytau_optimica.identification.physical.mechanical_form import MechanicalForm
from gantrytau_optimica.identification.rigid.robot_dynamics import IdentificationError

POSITION = 0.5  # |C B| w / |C A B| at the fastest mode; 0 for positions, 1 / (2 zeta) for speeds
STAYS = 0.1  # |C A^-1 B| w / |C B| of positions whose model lacks modes, at the least; 0 of speeds
GROWS = 1e-6  # of the largest pole, beyond the edge of stability: double poles on it are off by 1e-8
SEEN = 1e-10  # of the largest, singular values of [C; C A] in equal units below which a mode is not seen


def continuous_of(system: LinearSystem) -> LinearSystem:
    """The system as a continuous one, checked to be stable and of order 2 n with n outputs and n inputs."""
    order, outputs, inputs = len(system.A), len(system.C), system.B.shape[1]
    name = f"physical_form of {system.title}"
    if outputs != inputs or not outputs:
        raise ModelError(
            f"found {outputs} outputs and {inputs} inputs, expected as many: forces, and positions along them; "
            "identify a model with these alone",
            place=name,
            argument="system",
        )
    if order != 2 * outputs:
        remedy = f"identify a model of order {2 * outputs}" + (
            f", or with {order // 2} positions and forces" if order % 2 == 0 and order else ""
        )
        raise ModelError(
            f"found order {order} with {outputs} positions, expected {2 * outputs}, a position and a speed each; {remedy}",
            place=name,
            argument="system",
        )
    poles = system.poles
    edge = np.real(poles).max() if system.period is None else np.abs(poles).max() - 1
    if edge > GROWS * np.abs(poles).max():
        worst = poles[np.argmax(np.real(poles) if system.period is None else np.abs(poles))]
        raise IdentificationError(
            f"{name}: found the unstable pole {'s' if system.period is None else 'z'} = {worst:.6g}, expected a structure "
            "that comes to rest; identify the model from more data, or of another order"
        )
    return system if system.period is None else system.continuous()


def speed_jump(system: LinearSystem) -> float:
    """How far outputs jump in speed with a force, |C B| w / |C A B| at the fastest mode w: 0 of positions."""
    w = float(np.abs(np.linalg.eigvals(system.A)).max())
    size = float(np.linalg.norm(system.C @ system.A @ system.B))
    return float(np.linalg.norm(system.C @ system.B)) * w / size if size else np.inf


def _gives_way(system: LinearSystem, w: float) -> bool:
    """Whether outputs stay where a constant force has moved them, as positions do and speeds do not."""
    if np.linalg.cond(system.A) > 1 / np.finfo(float).eps:
        return False
    stays = system.C @ np.linalg.solve(system.A, system.B)
    return bool(np.linalg.norm(stays) * w > STAYS * np.linalg.norm(system.C @ system.B))


def direct_form(name: str, system: LinearSystem) -> MechanicalForm:
    """M, D and K of a continuous system, neither symmetric nor definite by construction.

    Raises IdentificationError for outputs that are no positions, and where they do not show all modes.
    """
    A, B, C = system.A, system.B, system.C
    n = len(C)
    w = float(np.abs(np.linalg.eigvals(A)).max())
    inverse_mass = C @ A @ B
    seen = np.linalg.svd(np.vstack([C, C @ A / w]) / np.linalg.norm(C), compute_uv=False) if w else [0.0]
    if not seen[-1] > SEEN * seen[0]:
        raise IdentificationError(
            f"{name}: found modes that the outputs do not show, expected {n} positions that tell all of order {2 * n}; "
            "measure at other places, or identify a model of lower order"
        )
    size = float(np.linalg.norm(inverse_mass))
    if not size or np.linalg.cond(inverse_mass) > 1 / np.finfo(float).eps:
        raise IdentificationError(
            f"{name}: found C A B = {inverse_mass.tolist()}, which has no inverse, expected that every force accelerates a "
            "position of its own; give forces and positions in independent directions"
        )
    if speed_jump(system) > POSITION and not _gives_way(system, w):
        raise IdentificationError(
            f"{name}: found outputs that jump in speed with a force (|C B| w / |C A B| = {speed_jump(system):.2g} at "
            f"{w / (2 * np.pi):.3g} Hz), expected positions, for which it is 0; integrate speeds, and look for a delay "
            "between forces and positions"
        )
    T = np.vstack([C, C @ A])
    # the lower rows of T A T^-1
    lower = np.linalg.solve(T.T, (C @ A @ A).T).T
    M = np.linalg.inv(inverse_mass)
    return MechanicalForm(M, -M @ lower[:, n:], -M @ lower[:, :n])
