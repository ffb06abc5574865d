"""Start values without nominal ones: the closure equation is linear in (A, v, A.A - L^2, A.v, v.v).

T.T = 2 A.T + 2 v.(q T) - (A.A - L^2) - q 2 A.v - q2 v.v,     and with a plate that turns less
      2 B.(R'T) - 2 A'R B - 2 q v'R B, where A B' and v B' count as numbers of their own
"""

import numpy as np

from gantrytau_optimica.calibration.links.closure import Chain, centre, triangle

HELD = 1e-7  # of the largest singular value; what is held worse in the linear equations is left at zero


def linear_start(chain: Chain) -> np.ndarray:
    """Numbers (L, A, v[, B]) of a link with a linear guideway from its measured poses alone.

    Where R is measured but hardly varies, B is left at zero, and A takes what R B adds.
    """
    centre_q, centre_r = centre(chain)
    U = triangle(chain, centre_q, centre_r)
    scale = np.linalg.norm(U, axis=0)
    U = U / np.where(scale > 0, scale, 1.0)
    left, singular, right = np.linalg.svd(U[:, :-1], full_matrices=False)
    held = singular > HELD * singular[0]
    theta = right[held].T @ ((left[:, held].T @ -U[:, -1]) / singular[held]) * scale[-1] / scale[:-1]
    A, v = theta[3:6] / -2, theta[6:9] / -2
    B = theta[9:12] / 2 if chain.R is not None else np.zeros(3)
    # |y|^2 with these is L^2 in the mean
    found = np.concatenate([[0.0], A + centre_r - centre_q * v, v, B])[: chain.size]
    y = chain.vector(found)
    found[0] = np.sqrt(np.mean(np.einsum("ij,ij->i", y, y)))
    return found
