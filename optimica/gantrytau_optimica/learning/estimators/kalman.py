"""The tool by a model of how the arms give way, corrected by an accelerometer: Dressler (2012), section 7.3, case 2B.

The model goes from kinematics z_c to the tool, x+ = A x + B z_c, z = C x + D z_c. What is measured beyond it, d, moves it:

    d   = a_m - second difference of z / Ts^2                          what the model does not explain
    e+  = A e + w,  d = C (e+ - 2 e + e-) / Ts^2 + n                   (7.19) to (7.21), cov w = r I, cov n = R2
    zhat = z + C ehat                                                  (7.22), with the stationary gain

The states are extended by C e and C e- instead of speed and acceleration, which are their differences. Those of (7.21) look
back, and are half a sample and one sample late; here a reading stands beside the second difference around it, so nothing is.
r I holds in balanced coordinates, in m, so that the states in which a model was found do not matter.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from gantrytau import ModelError, Result
from gantrytau.answers.linear_systems.linear_system import LinearSystem
from gantrytau.border.checks import instance, number
from gantrytau_optimica.learning.estimators.estimator import Estimator, sampling_period
from gantrytau_optimica.learning.pose_maps import PoseMap

AXES = 3  # of the kinematics
LASTING = 1e-6  # of its size, that a motion must lose at least from sample to sample to come to rest
SAME = 1e-6  # relative, by which periods may differ
HELD = 0.1  # m per m, by which a model may leave the kinematics at rest
UNSEEN = 1e-6  # of the largest Hankel singular value, below which a state is not driven, or not seen
SLOWER = 1e-12  # less than 1, that the size of poles of the filter may be


@dataclass(frozen=True, eq=False, repr=False)
class Kalman(Estimator):
    """A model of the arms from kinematics to the tool, with an accelerometer by a stationary Kalman filter.

    system: sampled, from z_c (3 axes, in m) to the tool (3 axes, or x and y alone), such as `identify_system` finds; axes
    that it does not have are those of the kinematics. r: m2, variance of what moves each state beside the model, near
    zero for a model that is trusted. noise: m/s2, deviation of accelerations beside the model, or their covariance R2
    (p, p) in m2/s4, which `with_noise_of` finds; the default is that of the accelerometer alone.
    Raises ModelError for systems of other axes, continuous ones, those that do not come to rest, or not where the arms hold
    the tool, for r and noise that are not above zero, and where there is no stationary filter.
    """

    system: LinearSystem
    r: float = 1e-12
    noise: ArrayLike = 0.07
    reads = ("z", "a")

    def __post_init__(self):
        number("Kalman", "r", self.r, above=0.0)  # a tiny one follows the model alone
        _check_system(self.system)
        _ = self._correction  # refused here, if at all

    def __repr__(self) -> str:
        noise = np.round(np.sqrt(np.diag(_covariance(self.noise, len(self.system.C)))), 3).tolist()
        return f"<Kalman: {self.system.title}, r={self.r:g} m2, noise={noise} m/s2>"

    def combine(self, signals: Mapping[str, np.ndarray], period: float) -> np.ndarray:
        z, a = (np.asarray(signals[letter], dtype=float) for letter in self.reads)
        self._check_period(period)
        simulated, left = self._unexplained(z, a)
        found = z.copy()
        found[:, : len(self.system.C)] = simulated + answered(self._correction, left)[0]
        return found

    def with_noise_of(self, run: Result, kinematics: PoseMap) -> "Kalman":
        """The same with the covariance R2 of measured less simulated accelerations of a run, (7.22).

        Raises ModelError as `estimate` does.
        """
        signals = self.signals(run, kinematics)
        self._check_period(sampling_period(run))
        return replace(self, noise=np.cov(self._unexplained(signals["z"], signals["a"])[1].T))

    def _check_period(self, period: float) -> None:
        own = float(self.system.period or 0.0)
        if abs(own - period) > SAME * period:
            raise ModelError(
                f"Kalman: found a model every {own:g} s and a run every {period:g} s, expected one period; identify the "
                "model from a run of this rig",
                argument="system",
            )

    def _unexplained(self, z: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The tool by the model (N, p, ...) for kinematics (N, 3, ...), and accelerations that it does not explain."""
        of, period = self.system, float(self.system.period or 0.0)
        simulated, x = answered((of.A, of.B, of.C, of.D), z)
        # behind the end kinematics goes on as it went; before the beginning is rest
        behind = _times(of.C, x) + _times(of.D, 2 * z[-1] - z[-2])
        around = np.concatenate([np.zeros_like(behind)[None], simulated, behind[None]])
        return simulated, a[:, : len(of.C)] - np.diff(around, 2, axis=0) / period**2

    @cached_property
    def _correction(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """From unexplained accelerations d in m/s2 to what the model lacks in m, a sampled system A, B, C, D."""
        square = float(self.system.period or 0.0) ** 2
        R2 = _covariance(self.noise, len(self.system.C)) * square**2
        A, C = balanced(self.system.A, self.system.B, self.system.C)
        n, p = len(A), len(C)
        # states e+, C e, C e-
        A = np.block(
            [
                [A, np.zeros((n, 2 * p))],
                [C, np.zeros((p, 2 * p))],
                [np.zeros((p, n)), np.eye(p), np.zeros((p, p))],
            ]
        )
        C_d = np.hstack([C, -2 * np.eye(p), np.eye(p)])
        gain = stationary_gain(A, C_d, self.r * np.diag(np.arange(n + 2 * p) < n).astype(float), R2)
        C_z = np.hstack([np.zeros((p, n)), np.eye(p), np.zeros((p, p))])
        update = np.eye(n + 2 * p) - gain @ C_d
        return A @ update, A @ gain * square, C_z @ update, C_z @ gain * square


def stationary_gain(A: np.ndarray, C: np.ndarray, R1: np.ndarray, R2: np.ndarray) -> np.ndarray:
    """M (n, p) of xhat[k | k] = xhat[k | k - 1] + M (y - C xhat[k | k - 1]), from noises x+ = A x + w, y = C x + n.

    cov w = R1 (n, n), cov n = R2 (p, p). Raises ModelError where rounding leaves no filter that forgets its beginning.
    """
    from scipy.linalg import solve, solve_discrete_are

    size, gain, slowest = np.trace(R2), np.zeros(C.T.shape), np.nan
    try:
        P = solve_discrete_are(A.T, C.T, R1 / size, R2 / size)
        gain = solve(C @ P @ C.T + R2 / size, C @ P, assume_a="pos").T
        slowest = float(np.abs(np.linalg.eigvals(A - A @ gain @ C)).max())
    except (np.linalg.LinAlgError, ValueError):
        pass  # told below
    if not slowest < 1 - SLOWER:
        raise ModelError(
            f"Kalman: found no stationary filter to rounding, for R1 of {np.trace(R1):.3g} m2 in all beside R2 of "
            f"{size:.3g} m2, as positions from sample to sample, expected noises nearer to each other; take a smaller r, or "
            "more noise",
            argument="r",
        )
    return gain


def balanced(A: np.ndarray, B: np.ndarray, C: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A and C in coordinates that are driven as much as they are seen; states that are not, by 1e-6, are left out.

    Moore (1981): Gramians are equal and diagonal, their elements the Hankel singular values.
    """
    from scipy.linalg import matrix_balance, solve_discrete_lyapunov

    _, units = matrix_balance(A, permute=False)
    A, B, C = np.linalg.solve(units, A @ units), np.linalg.solve(units, B), C @ units
    # Gramians of states of unlike sizes are lost to rounding; a second pass finds like ones
    for _ in range(2):
        driven, seen = (_root(solve_discrete_lyapunov(*pair)) for pair in ((A, B @ B.T), (A.T, C.T @ C)))
        U, hankel, V = np.linalg.svd(seen.T @ driven)
        kept = hankel > UNSEEN * hankel.max(initial=0.0)
        if not kept.any():
            raise ModelError(
                "Kalman: found a model without a state that kinematics moves and the tool shows, expected one with "
                "resonances; identify one of a higher order, or take Kinematic()",
                argument="system",
            )
        root = np.sqrt(hankel[kept])
        there, back = driven @ V[kept].T / root, (U[:, kept] / root).T @ seen.T
        A, B, C = back @ A @ there, back @ B, C @ there
    return A, C


def answered(
    system: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray], u: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Outputs (N, p, ...) of A, B, C, D from rest for many inputs (N, m, ...) at once, and the state behind the end."""
    A, B, C, D = system
    inputs = u.reshape(*u.shape[:2], -1)
    n, count = len(A), inputs.shape[2]
    whole, found = np.block([[A, B], [C, D]]), np.empty((len(u), len(C), count))
    given, next_and_output = np.zeros((n + len(B.T), count)), np.empty((n + len(C), count))
    for k, one in enumerate(inputs):
        given[n:] = one
        np.matmul(whole, given, out=next_and_output)
        given[:n], found[k] = next_and_output[:n], next_and_output[n:]
    return found.reshape(len(u), len(C), *u.shape[2:]), given[:n].reshape(n, *u.shape[2:])


def _times(matrix: np.ndarray, x: np.ndarray) -> np.ndarray:
    return np.tensordot(matrix, x, axes=1)


def _root(square: np.ndarray) -> np.ndarray:
    values, vectors = np.linalg.eigh((square + square.T) / 2)
    return vectors * np.sqrt(np.maximum(values, 0.0))


def _covariance(noise: ArrayLike, axes: int) -> np.ndarray:
    """R2 (p, p) of a deviation or a covariance. Raises ModelError for what is neither."""
    found = np.asarray(noise, dtype=float)
    if found.ndim == 0 and 0 < found < np.inf:
        return float(found) ** 2 * np.eye(axes)
    symmetric = (
        found.shape == (axes, axes) and np.all(np.isfinite(found)) and np.allclose(found, found.T, atol=0)
    )
    if symmetric and np.linalg.eigvalsh(found).min() > 0:
        return found
    raise ModelError(
        f"Kalman: found noise={noise!r}, expected a deviation above zero in m/s2, or a covariance ({axes}, {axes}) in "
        "m2/s4, symmetric and positive definite",
        argument="noise",
    )


def _check_system(system: LinearSystem) -> None:
    expected = "a sampled linear one such as identify_system finds"
    instance("Kalman", "system", system, LinearSystem, expected)
    if system.period is None:
        raise ModelError(
            f"Kalman: found {system.title} that is continuous, expected a sampled one; take system.discrete(period)",
            argument="system",
        )
    p, m = system.D.shape
    if m != AXES or p not in (2, AXES):
        raise ModelError(
            f"Kalman: found a model with {m} inputs and {p} outputs, expected from the kinematic position of the tool, x, y "
            "and z, to its position, x, y and z, or x and y",
            argument="system",
        )
    sizes = np.abs(system.poles)
    if sizes.size and not sizes.max() < 1 - LASTING:
        pole, hertz = (values[np.argmax(sizes)] for values in (system.poles, system.eigenfrequencies))
        why = (
            "accelerations never show where it is"
            if hertz < LASTING / system.period
            else "a motion of it goes on"
        )
        raise ModelError(
            f"Kalman: found a model with a pole z = {pole:.6g}, |z| = {abs(pole):.6g}, at {hertz:.3g} Hz, expected one that "
            f"comes to rest: {why}, and there is no stationary filter; identify it from outputs without drift, with more "
            "samples or of a lower order",
            argument="system",
        )
    held = np.real(system.response([0.0])[:, :, 0])
    off = np.abs(held - np.eye(p, m))
    if not off.max() < HELD:
        i, j = np.unravel_index(int(np.argmax(off)), off.shape)
        raise ModelError(
            f"Kalman: found a model that at rest moves the tool in {'xyz'[i]} by {held[i, j]:.3g} m for 1 m of kinematics "
            f"in {'xyz'[j]}, expected {i == j:d} m, as arms do not bend at rest; look at the order of axes and at units",
            argument="system",
        )
