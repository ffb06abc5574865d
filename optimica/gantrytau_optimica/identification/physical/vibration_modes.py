"""Modes of M z'' + D z' + K z = f: det(M s^2 + D s + K) = 0."""

from dataclasses import dataclass

import numpy as np

from gantrytau.describing.record import Record

REAL = 1e-9  # of the size of a pole, to which one is taken as real


@dataclass(frozen=True, eq=False)
class Modes(Record):
    """Modes, the slowest first: one for each pair of poles, one for each real pole.

    poles: s in 1/s, (k,) complex with imaginary parts of at least zero; shapes: motion of the n coordinates, (n, k)
    complex, the largest of each 1.
    """

    poles: np.ndarray
    shapes: np.ndarray

    @property
    def frequencies(self) -> np.ndarray:
        """|s| / 2 pi, (k,) in Hz."""
        return np.abs(self.poles) / (2 * np.pi)

    @property
    def damping(self) -> np.ndarray:
        """-Re(s) / |s|, (k,): 1 of what only decays, below zero of what grows; 1 where s = 0."""
        sizes = np.abs(self.poles)
        return np.where(sizes > 0, -np.real(self.poles) / np.where(sizes > 0, sizes, 1.0), 1.0)

    def __repr__(self) -> str:
        lines = [
            f"  {hertz:.4g} Hz, damping {damping:.3g}, shape {np.array2string(shape, precision=2)}"
            for hertz, damping, shape in zip(
                self.frequencies, self.damping, np.real_if_close(self.shapes, 1e6).T, strict=True
            )
        ]
        return "\n".join(["<Modes", *lines]) + ">"


def modes_of(M: np.ndarray, D: np.ndarray, K: np.ndarray) -> Modes:
    """The modes of three matrices (n, n), M one that has an inverse."""
    n = len(M)
    inverse = np.linalg.inv(M)
    s, vectors = np.linalg.eig(np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ K, -inverse @ D]]))
    kept = np.imag(s) > -REAL * np.abs(s)
    s, shapes = s[kept], vectors[:n, kept]
    s = np.where(np.abs(np.imag(s)) <= REAL * np.abs(s), np.real(s), s)
    shapes = shapes / shapes[np.argmax(np.abs(shapes), axis=0), range(shapes.shape[1])]
    order = np.argsort(np.abs(s), kind="stable")
    return Modes(s[order].astype(complex), shapes[:, order])


def without_damping(M: np.ndarray, K: np.ndarray) -> np.ndarray:
    """Resonances sqrt(lambda) / 2 pi of det(K - M lambda) = 0, (n,) in Hz, rising; NaN for other lambda.

    Dressler (2012), (6.15), where the printed K is minus the stiffness: s^2 = -lambda.
    """
    values = np.linalg.eigvals(np.linalg.solve(M, K)).astype(complex)
    swings = (np.abs(np.imag(values)) <= REAL * np.abs(values)) & (np.real(values) >= 0)
    return np.sort(np.where(swings, np.sqrt(np.where(swings, np.real(values), 0.0)) / (2 * np.pi), np.nan))
