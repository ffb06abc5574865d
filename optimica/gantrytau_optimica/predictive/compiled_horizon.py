"""A horizon as machine code of this computer: the controller's C, whose linearisation and program are called one by one."""

import ctypes
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau.answers.sampled_code import SampledCode
from gantrytau.kernels import SMALL, code_size, library
from gantrytau_optimica.predictive.plan import PlannedMotion
from gantrytau_optimica.predictive.stages import HorizonStages

PLAIN = """
#pragma GCC push_options
#pragma GCC optimize ("O0")
#ifdef __clang__
#pragma clang optimize off
#endif
"""
OPTIMISED = """
#ifdef __clang__
#pragma clang optimize on
#endif
#pragma GCC pop_options
"""
EXPORTS = """
int horizon_size(void) { return (int)sizeof(controller_state); }

/* How far the unknowns are from solving their equations, below 0 where these are singular or a number is not finite. */
double horizon_load(controller_state *it, double t) {
    double missed = 0;
    int i, k;
    if (!mpc_load(it, t)) return -1;
    for (k = 0; k < MPC_N; k++) for (i = 0; i < MPC_NW; i++) {
        const double by = fabs(it->work.unknowns[k][i][0]);
        if (!isfinite(by)) return -1;
        missed = fmax(missed, by);
    }
    return missed;
}

double horizon_change(controller_state *it, const double *x, double *slack) {
    const double change = mpc_change(it, x);
    int i, k;
    for (k = 0; k < MPC_N; k++)
        for (slack[k] = 0, i = MPC_NQ + MPC_NU; i < MPC_NE; i++) slack[k] = fmax(slack[k], it->work.stages[k].v[i]);
    return change;
}
"""


class CompiledHorizon:
    """The functions of a compiled library. It has memory for one plan, the one of `controller_state`."""

    def __init__(self, path: Path, stages: HorizonStages, elements: int):
        n, nx, nw, nu = elements, stages.nx, stages.nw, stages.nu
        own: Any = ctypes.CDLL(str(path))
        own.horizon_load.argtypes, own.horizon_load.restype = (
            [ctypes.c_void_p, ctypes.c_double],
            ctypes.c_double,
        )
        own.horizon_change.argtypes, own.horizon_change.restype = [ctypes.c_void_p] * 3, ctypes.c_double
        self._stages, self._load, self._change = stages, own.horizon_load, own.horizon_change
        self._memory = np.zeros(own.horizon_size() // 8 + 1)
        self._slack, self._state = np.zeros(n), np.zeros(nx)
        self._at = [one.ctypes.data for one in (self._memory, self._state, self._slack)]
        # the plan, another one, the inputs that are applied, and estimates
        sizes, known = [(n + 1) * nx, n * nw, n * nu], len(stages.phase.courses)
        self._x, self._w, self._u, _, self._applied, self._known, _ = np.split(
            self._memory, np.cumsum([*sizes, sum(sizes), nu, known])
        )

    def load(self, plan: PlannedMotion, applied: np.ndarray) -> float:
        """Linearise at a plan; how far its unknowns are from solving their equations, below 0 without numbers."""
        self._x[:], self._w[:], self._u[:] = plan.x.ravel(), plan.w.ravel(), plan.u.ravel()
        self._applied[:] = applied
        if self._known.size:
            self._known[:] = self._stages.course_values(np.array([plan.t]))[:, 0]
        return self._load(self._at[0], plan.t)

    def changed(self, plan: PlannedMotion, first: np.ndarray) -> tuple[PlannedMotion, float, np.ndarray]:
        """The loaded plan changed by its program's solution from a first state (nx,); its largest change, below 0 without
        a solution, and the largest slacks (N,).
        """
        self._state[:] = first
        change = self._change(*self._at)
        x, w, u = (
            own.reshape(one.shape).copy()
            for own, one in ((self._x, plan.x), (self._w, plan.w), (self._u, plan.u))
        )
        return PlannedMotion(x, w, u, plan.t), change, self._slack.copy()


def compiled_horizon(code: SampledCode, stages: HorizonStages, elements: int) -> CompiledHorizon | None:
    """The horizon of a controller's C; None where it cannot be compiled or loaded."""
    begin, end = '#include "controller.h"', "#include <math.h>\n#include <string.h>"
    plain = code_size(stages.point) > SMALL  # long straight code takes a compiler minutes to optimise
    text = code.source.replace(begin, code.header + PLAIN * plain).replace(end, OPTIMISED * plain + end, 1)
    path = library(text + EXPORTS)
    if path is not None:
        with suppress(OSError):  # of another computer
            return CompiledHorizon(path, stages, elements)
    return None
