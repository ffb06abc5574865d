"""A motion with rockit's direct collocation as its user writes it; all that it has are controls constant in each element."""

from __future__ import annotations

from collections.abc import Callable
from time import process_time
from typing import Any

import casadi as ca
import numpy as np
from rockit import DirectCollocation, FreeTime, Ocp  # pyright: ignore[reportMissingImports]

from tests.benchmarks.peers.written import IPOPT, Motion, Outcome

KNOTS = 201  # of the tables of first guesses


def solve(write: Callable[[], Motion], elements: int, points: int = 3) -> Outcome:
    """Write down, build and solve a motion."""
    began = process_time()
    motion = write()
    ocp: Any = Ocp(T=FreeTime(motion.guessed_time))  # pyright: ignore[reportArgumentType]
    x, u = ocp.state(motion.x.numel()), ocp.control(motion.u.numel())
    z = ocp.algebraic(motion.z.numel()) if motion.z.numel() else ca.MX(0, 1)
    ode, residual, path = motion.point()(x, z, u)
    ocp.set_der(x, ode)
    if motion.residual.numel():
        ocp.add_alg(residual)
    if motion.path.numel():
        ocp.subject_to(motion.path_limits[0] <= (path <= motion.path_limits[1]))
    for symbol, low, high in zip((x, z, u), *map(motion.parts, motion.limits), strict=True):
        for k in range(low.size):
            if np.isfinite(low[k]):
                ocp.subject_to(symbol[k] >= low[k])
            if np.isfinite(high[k]):
                ocp.subject_to(symbol[k] <= high[k])
    ocp.subject_to(ocp.at_t0(x) == motion.start)
    ocp.subject_to(ocp.at_tf(x) == motion.end)
    ocp.subject_to(ocp.T >= motion.times[0])
    ocp.add_objective(ocp.T)
    # first guesses have to be expressions of the time: tables, linear in between
    shares = np.linspace(0.0, 1.0, KNOTS)
    for symbol, table in zip((x, z, u), motion.guess(shares), strict=True):
        if table.size:
            times = (shares * motion.guessed_time).tolist()
            lookup = ca.interpolant("lookup", "linear", [times], table.T.ravel().tolist())
            ocp.set_initial(symbol, lookup(ocp.t))
    options = {"expand": True, "print_time": False, "record_time": True}
    ocp.solver("ipopt", options | {"ipopt": IPOPT})
    ocp.method(DirectCollocation(N=elements, degree=points, scheme="radau"))
    solution = ocp.solve()
    ended, stats = process_time(), solution.stats
    solving = stats["t_proc_total"]  # rockit transcribes when it solves: that is building
    return Outcome(
        float(solution.value(ocp.T)),
        stats["iter_count"],
        ended - began - solving,
        solving,
        bool(stats["success"]),
        int(ocp._method.opti.nx),
    )
