"""How sure places are apart from where their axes lie: what is left of a covariance once a motion of all is taken out.

Axes of a camera are themselves uncertain, so that places in them vary with the distance from it. Who compares places with
those of another device, or calibrates a robot in a frame of its own, sees P cov(r) P with P = I - Q Q', the columns of Q six
motions of all places at once (free network: Meissl 1969).
"""

import numpy as np

from gantrytau.kinematics.rotations import skewed

Array = np.ndarray


def free_covariance(r: Array, own: Array, coupling: Array, shared: Array) -> tuple[Array, Array]:
    """Covariances (N, 3, 3) of places r (N, 3), in m2, after the best motion of all, and what of it they share: factors F
    (N, 3, S), F_i F_j' the covariance of two of them.

    Before it they are own_k + coupling_k shared coupling_k'.

    own: (N, 3, 3); coupling: (N, 3, S); shared: (S, S).
    """
    away = r - r.mean(axis=0)
    motions = np.concatenate([np.broadcast_to(np.eye(3), (len(r), 3, 3)), skewed(away)], axis=2)
    Q = np.linalg.qr(motions.reshape(-1, 6))[0].reshape(len(r), 3, 6)
    turned = Q.transpose(0, 2, 1)
    weighted = own @ Q
    middle = np.sum(turned @ weighted, axis=0)
    corrected = weighted @ turned
    found = own - corrected - corrected.transpose(0, 2, 1) + Q @ middle @ turned
    free = coupling - Q @ np.sum(turned @ coupling, axis=0)
    values, axes = np.linalg.eigh(shared)
    factor = free @ (axes * np.sqrt(np.maximum(values, 0.0)))
    return found + factor @ factor.transpose(0, 2, 1), factor
