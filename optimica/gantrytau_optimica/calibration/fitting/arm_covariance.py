"""How sure the numbers of arms with turntables are, all arms together.

    cov p_a, p_b = C_a (sum_k J_ak' cov(e_ak, e_bk) J_bk) C_b,      C = S (S J'J S + prior)^-1 S in directions that are held

Links of all arms share the noise of a pose, so that numbers of different arms vary together (see `covariance.py`).
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from gantrytau_optimica.calibration.data.measurements import Measurements
from gantrytau_optimica.calibration.fitting.arm_fit import BLOCK, NOISE, TAPE, scales, triangle
from gantrytau_optimica.calibration.fitting.covariance import pose_noise
from gantrytau_optimica.calibration.rods.arm_poses import pose_rows
from gantrytau_optimica.calibration.rods.arms import Arm


def held_directions(
    arm: Arm, data: Measurements, prior: Mapping[str, float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Singular values of the scaled slopes of an arm with its prior, their directions in rows, and which are held."""
    scale = scales(arm)
    factor = triangle(arm, data.q, data.r, data.R, scale)[:, :-1]
    _, singular, directions = np.linalg.svd(
        np.vstack([factor, np.diag(pulls(arm, prior) * scale)]), full_matrices=False
    )
    return singular, directions, singular >= NOISE / TAPE * (1 - 1e-6)


def pulls(arm: Arm, prior: Mapping[str, float]) -> np.ndarray:
    """Weights of nominal values against a closure error, (p,)."""
    deviations = [prior.get(name, prior.get(name.rpartition("[")[0], np.inf)) for name in arm.names]
    return NOISE / np.array(deviations)


def arms_covariance(arms: Sequence[Arm], data: Measurements, prior: Mapping[str, float]) -> np.ndarray:
    """Covariance of the numbers of all arms one after another, (n, n)."""
    deviations, factors = _noise(arms, data)
    ends = np.cumsum([0, *(arm.count for arm in arms)])
    parts = [slice(first, last) for first, last in pairwise(ends)]
    middle = np.zeros((ends[-1], ends[-1]))
    for first in range(0, len(data), BLOCK):
        rows = slice(first, first + BLOCK)
        moved = pose_rows(arms, data.q[rows], data.r[rows], None if data.R is None else data.R[rows])
        moved = moved * deviations * factors[:, None]
        slopes, start = [], 0
        for arm in arms:
            J = arm.closure(data.q[rows], data.r[rows], None if data.R is None else data.R[rows])[1]
            own = moved[:, start : start + len(arm.links)]
            slopes.append(np.einsum("nmp,nmc->ncp", J, own).reshape(-1, arm.count))
            start += len(arm.links)
        # noise of one pose, six numbers, moves the sums J'e of all arms
        for a, mine in zip(parts, slopes, strict=True):
            for b, other in zip(parts, slopes, strict=True):
                middle[a, b] += mine.T @ other
    outer = np.zeros_like(middle)
    noise = float(np.sqrt(np.mean([np.mean(arm.closure(data.q, data.r, data.R)[0] ** 2) for arm in arms])))
    for arm, part in zip(arms, parts, strict=True):
        singular, directions, held = held_directions(arm, data, prior)
        half = scales(arm)[:, None] * directions[held].T / singular[held]
        outer[part, part] = half @ half.T
        middle[part, part] += np.diag((noise * pulls(arm, prior)) ** 2)
    return outer @ middle @ outer


def _noise(arms: Sequence[Arm], data: Measurements) -> tuple[np.ndarray, np.ndarray]:
    """Deviations of the pose, (6,) or (3,), and factors of the links, (links,)."""
    errors = np.hstack([arm.closure(data.q, data.r, data.R)[0] for arm in arms])
    moved = pose_rows(arms, data.q, data.r, data.R)
    share = np.concatenate([np.full(len(arm.links), _rank(arm, data) / len(arm.links)) for arm in arms])
    turned = moved[:, :, 3:] if moved.shape[2] > 3 else 0 * moved
    s, a, factors = pose_noise(errors, moved[:, :, :3], turned, np.maximum(len(errors) - share, 1.0))
    return np.array([s] * 3 + [a] * (moved.shape[2] - 3)), factors


def _rank(arm: Arm, data: Measurements) -> int:
    return int(held_directions(arm, data, {})[2].sum())
