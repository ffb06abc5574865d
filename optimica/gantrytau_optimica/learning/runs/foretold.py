"""Corrections of a plant held against what its response foretells: u_{k+1} = M u_k + ..., Dressler (2012), (7.16)."""

import numpy as np

from gantrytau_optimica.fitting.finding import Finding
from gantrytau_optimica.learning.laws.learning import Stability

# of the corrections, measured: the flexible robot under its actuators leaves 0.03 to 0.06, linear servos 0.001 to 0.16
# with up to 1 mm of noise, 0.36 to 0.75 where they are late by 25 samples, limited, or scatter by 5 mm
LEFT = 0.3


def not_as_foretold(u: np.ndarray, stability: Stability, first: int) -> tuple[Finding, ...]:
    """A finding "foretold" where corrections u (K + 1, N, m) of one law, from run `first` on, do not follow the response.

    On a linear plant that repeats itself u_{k+1} - u_1 = M (u_k - u_0).
    """
    moved = [(u[k] - u[0], u[k + 1] - u[1]) for k in range(1, len(u) - 1) if np.any(u[k] != u[0])]
    left = [np.linalg.norm(b - stability.next(a)) / np.linalg.norm(a) for a, b in moved]
    kept = [np.linalg.norm(b) / np.linalg.norm(a) for a, b in moved]
    rows = np.flatnonzero(np.array(left) > LEFT)
    if not rows.size:
        return ()
    k = int(rows[-1])
    words = (
        f"run {first + 1 + k} left {kept[k]:.2f} of its corrections to the next, {left[k]:.0%} of them otherwise than the "
        f"response foretells (at most {stability.sigma:.2f} in all): it is the response of another plant, forces or speeds "
        "are at a limit, or runs do not repeat themselves; measure the response again (response=None), look at the forces, "
        "or take `repeat`"
    )
    return (Finding("foretold", first + 1 + rows, words),)
