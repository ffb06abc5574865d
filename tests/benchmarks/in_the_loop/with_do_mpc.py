"""do-mpc as the controller of a loop: the equations of a problem, collocated with the two points that `Mpc` has."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping
from contextlib import redirect_stdout
from time import process_time
from typing import Any

import casadi as ca
import numpy as np

from gantrytau_optimica import Mpc

PENALTY = 1e4  # for passing a limit along the path, which holds exactly where it can

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # of its parts that are not used here
    from do_mpc.controller import MPC  # pyright: ignore[reportMissingImports]
    from do_mpc.model import Model  # pyright: ignore[reportMissingImports]


class WithDoMpc(Mpc):
    """A controller whose steps are those of do-mpc; `took`: processor time of each in s."""

    def __init__(self, problem: Any, *, period: float, elements: int):
        super().__init__(problem, period=period, elements=elements)
        self.took: list[float] = []
        stages, nx = self.stages, self.stages.nx
        model: Any = Model("continuous", "SX")
        x = model.set_variable("_x", "x", (nx, 1))
        model.set_variable("_x", "spent")
        u = model.set_variable("_u", "u", (stages.nu, 1))
        z = model.set_variable("_z", "z", (stages.nz, 1)) if stages.nz else ca.SX(0, 1)
        y, t, courses = stages.symbols

        def here(expression: ca.SX) -> ca.SX:
            return ca.substitute(expression, ca.vertcat(y, t, courses), ca.vertcat(x, z, u, 0.0))

        model.set_rhs("x", here(stages.equations[:nx]) / period)
        model.set_rhs("spent", here(stages.at_point(stages.phase.integrand)))
        if stages.nz:
            model.set_alg("residual", here(stages.equations[nx:]))
        model.setup()
        control: Any = MPC(model)
        control.settings.n_horizon, control.settings.t_step = elements, period
        control.settings.nl_cons_check_colloc_points = True
        control.settings.supress_ipopt_output()
        control.set_objective(mterm=model.x["spent"], lterm=ca.DM(0))
        control.set_rterm(u=0.0)
        control.bounds["lower", "_u", "u"] = stages.lower_u
        control.bounds["upper", "_u", "u"] = stages.upper_u
        lower, upper = (end[: len(stages.path)] for end in stages.rows)
        for k, limit in enumerate(stages.path):
            value = here(stages.at_point(limit.expression)) / limit.size
            own = dict(soft_constraint=True, penalty_term_cons=PENALTY)
            if np.isfinite(upper[k]):
                control.set_nl_cons(f"upper{k}", value, ub=upper[k], **own)
            if np.isfinite(lower[k]):
                control.set_nl_cons(f"lower{k}", -value, ub=-lower[k], **own)
        with open(os.devnull, "w") as nowhere, redirect_stdout(nowhere):
            control.setup()
        self._control = control
        self.reset()

    def reset(self) -> None:
        """Begin anew, from the guess of the model."""
        super().reset()
        self.took = []
        if hasattr(self, "_control"):
            self._control.reset_history()

    def step(self, measured: Mapping[str, Any], t: float = 0.0) -> dict[str, float]:
        """The inputs that do-mpc gives."""
        x = np.append(self.whole_state(measured) / self.stages.sizes_x, 0.0)
        if not self.took:
            self._control.x0 = x
            if self.stages.nz:
                self._control.z0 = self._first(x[:-1], t).w[
                    0, self.stages.nx : self.stages.nx + self.stages.nz
                ]
            self._control.set_initial_guess()
        begin = process_time()
        self._newton.applied = np.asarray(self._control.make_step(x)).ravel()
        self.took.append(process_time() - begin)
        self.status = "solved" if self._control.solver_stats["success"] else "failed"
        return self.held

    def prepare(self) -> None:
        """do-mpc prepares nothing."""
