"""A motion as a careful user of CasADi writes it: Radau collocation in SX, exact Hessian, Ipopt with MUMPS.

    sum_i D_ij x_i = h ode(x_j, z_j, u_j)      0 = residual(x_j, z_j, u_j)      lower <= path(x_j, z_j, u_j) <= upper

x_0 is the state at the start of the element, h its length in s; the last Radau point is the start of the next.
"""

from __future__ import annotations

from collections.abc import Callable
from time import process_time

import casadi as ca
import numpy as np

from tests.benchmarks.peers.written import IPOPT, Motion, Outcome


def solve(write: Callable[[], Motion], elements: int, points: int = 3) -> Outcome:
    """Write down, build and solve a motion."""
    began = process_time()
    motion = write()
    c = np.array(ca.collocation_points(points, "radau"))
    slopes, _, _ = ca.collocation_coeff(list(c))
    point, limits = motion.point(), list(zip(*map(motion.parts, motion.limits), strict=True))
    symbols, guess, bounds, rows, lower, upper = [], [], [], [], [], []

    def unknown(value: np.ndarray, limit: tuple[np.ndarray, np.ndarray]) -> ca.SX:
        symbols.append(ca.SX.sym("w", value.size))
        guess.append(value)
        bounds.append(limit)
        return symbols[-1]

    def row(value: ca.SX, low: float = 0.0, high: float = 0.0) -> None:
        rows.append(value)
        lower.append(np.full(value.numel(), low))
        upper.append(np.full(value.numel(), high))

    shortest, longest = (np.array([t]) for t in motion.times)
    T = unknown(np.array([motion.guessed_time]), (shortest, longest))
    h = T / elements
    first = x0 = unknown(motion.guess(np.zeros(1))[0][:, 0], limits[0])
    for element in range(elements):
        columns = motion.guess((element + c) / elements)
        ends = [unknown(column, limits[2]) for column in columns[2][:, [0, -1]].T] if motion.ramps else []
        # all x, all z, all u of an element: by points, the Hessian takes ten times as many colours
        x, z = ([unknown(column, limits[i]) for column in columns[i].T] for i in (0, 1))
        if motion.ramps:
            u = [ends[0] + share * (ends[1] - ends[0]) for share in c]
        else:
            u = [unknown(column, limits[2]) for column in columns[2].T]
        states = [x0, *x]
        inner = [point(*at) for at in zip(x, z, u, strict=True)]
        polynomial = ca.horzcat(*states) @ slopes
        for j, (ode, residual, path) in enumerate(inner):
            row(polynomial[:, j] - h * ode)
            row(residual)
            row(path, *motion.path_limits)
        x0 = states[-1]
    row(first - motion.start)
    row(x0 - motion.end)
    nlp = {"x": ca.vertcat(*symbols), "f": T, "g": ca.vertcat(*rows)}
    solver = ca.nlpsol("solver", "ipopt", nlp, {"ipopt": IPOPT, "print_time": False, "calc_lam_p": False})
    built = process_time()
    lbx, ubx = (np.concatenate(side) for side in zip(*bounds, strict=True))
    found = solver(
        x0=np.concatenate(guess), lbx=lbx, ubx=ubx, lbg=np.concatenate(lower), ubg=np.concatenate(upper)
    )
    solved, stats = process_time(), solver.stats()
    return Outcome(
        float(found["x"][0]), stats["iter_count"], built - began, solved - built, stats["success"], lbx.size
    )
