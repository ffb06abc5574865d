"""A motion with CasADi's Opti: the same Radau collocation in its own words. Simple bounds are handed to Ipopt as bounds."""

from __future__ import annotations

from collections.abc import Callable
from time import process_time
from typing import Any

import casadi as ca
import numpy as np

from tests.benchmarks.peers.written import IPOPT, Motion, Outcome


def solve(write: Callable[[], Motion], elements: int, points: int = 3) -> Outcome:
    """Write down, build and solve a motion."""
    began = process_time()
    motion = write()
    c = np.array(ca.collocation_points(points, "radau"))
    slopes, _, _ = ca.collocation_coeff(list(c))
    point, opti = motion.point().map(points), ca.Opti()
    limits = list(zip(*map(motion.parts, motion.limits), strict=True))

    def unknown(kind: int, guess: np.ndarray) -> ca.MX:
        symbol = opti.variable(*guess.shape)
        opti.set_initial(symbol, guess)
        low, high = (np.tile(side[:, None], guess.shape[1]) for side in limits[kind])
        if np.isfinite(low).any() or np.isfinite(high).any():
            opti.subject_to(opti.bounded(ca.vec(ca.DM(low)), ca.vec(symbol), ca.vec(ca.DM(high))))
        return symbol

    T = opti.variable()
    opti.set_initial(T, motion.guessed_time)
    opti.subject_to(opti.bounded(motion.times[0], T, motion.times[1]))
    first = x0 = unknown(0, motion.guess(np.zeros(1))[0])
    for element in range(elements):
        columns = motion.guess((element + c) / elements)
        x = unknown(0, columns[0])
        z = unknown(1, columns[1]) if motion.z.numel() else ca.MX(0, points)
        u = unknown(2, columns[2][:, [0, -1]] if motion.ramps else columns[2])
        if motion.ramps:
            u = u @ ca.DM(np.vstack([1 - c, c]))
        ode, residual, path = point(x, z, u)
        opti.subject_to(ca.vec(ca.horzcat(x0, x) @ slopes - T / elements * ode) == 0)
        if motion.residual.numel():
            opti.subject_to(ca.vec(residual) == 0)
        if motion.path.numel():
            opti.subject_to(opti.bounded(motion.path_limits[0], ca.vec(path), motion.path_limits[1]))
        x0 = x[:, -1]
    opti.subject_to(first == motion.start)
    opti.subject_to(x0 == motion.end)
    opti.minimize(T)
    options = {"expand": True, "detect_simple_bounds": True, "print_time": False, "record_time": True}
    opti.solver("ipopt", options | {"ipopt": IPOPT})
    try:
        found: Any = opti.solve()
    except RuntimeError:  # not converged, or not in time
        found = opti.debug
    ended, stats = process_time(), opti.stats()
    solving = stats["t_proc_total"]  # Opti sets its solver up when it solves: that is building
    return Outcome(
        float(found.value(T)),
        stats["iter_count"],
        ended - began - solving,
        solving,
        bool(stats["success"]),
        int(opti.nx),
    )
