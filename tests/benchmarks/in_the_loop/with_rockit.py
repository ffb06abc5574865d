"""rockit as the controller of a loop: the equations of a problem, collocated with the two points that `Mpc` has."""

from __future__ import annotations

from collections.abc import Mapping
from time import process_time
from typing import Any

import casadi as ca
import numpy as np
from rockit import DirectCollocation, Ocp  # pyright: ignore[reportMissingImports]

from gantrytau_optimica import Mpc
from tests.benchmarks.in_the_loop.with_do_mpc import PENALTY


class WithRockit(Mpc):
    """A controller whose steps are those of rockit; `took`: processor time of each in s."""

    def __init__(self, problem: Any, *, period: float, elements: int):
        super().__init__(problem, period=period, elements=elements)
        self.took: list[float] = []
        stages = self.stages
        ocp: Any = Ocp(T=elements * period)  # pyright: ignore[reportArgumentType]
        x, u = ocp.state(stages.nx), ocp.control(stages.nu)
        z = ocp.algebraic(stages.nz) if stages.nz else ca.MX(0, 1)
        limits = ca.vertcat(ca.SX(0, 1), *(limit.expression / limit.size for limit in stages.path))
        inner = [stages.equations, stages.at_point(stages.phase.integrand), stages.at_point(limits)]
        point = ca.Function("point", [stages.symbols[0]], inner, {"cse": True})
        equations, integrand, rows = point(ca.vertcat(x, z, u))
        ocp.set_der(x, equations[: stages.nx] / period)
        if stages.nz:
            ocp.add_alg(equations[stages.nx :])
        ocp.add_objective(ocp.integral(integrand))
        if stages.path:
            passed = ocp.control()
            ocp.subject_to(passed >= 0)
            ocp.add_objective(ocp.integral(PENALTY / period * passed))
            lower, upper = (end[: len(stages.path)] for end in stages.rows)
            for k in range(len(stages.path)):
                if np.isfinite(upper[k]):
                    ocp.subject_to(rows[k] - passed <= upper[k], grid="integrator_roots")
                if np.isfinite(lower[k]):
                    ocp.subject_to(rows[k] + passed >= lower[k], grid="integrator_roots")
        for k in range(stages.nu):
            if np.isfinite(stages.lower_u[k]):
                ocp.subject_to(u[k] >= stages.lower_u[k])
            if np.isfinite(stages.upper_u[k]):
                ocp.subject_to(u[k] <= stages.upper_u[k])
        start = ocp.parameter(stages.nx)
        ocp.subject_to(ocp.at_t0(x) == start)
        ocp.solver("ipopt", {"expand": True, "print_time": False, "ipopt": {"print_level": 0, "sb": "yes"}})
        ocp.method(DirectCollocation(N=elements, degree=2, scheme="radau"))
        ocp.set_value(start, np.zeros(stages.nx))
        plan = [ocp.sample(ocp.x, grid="control")[1], ocp.sample(ocp.u, grid="control-")[1]]
        self._solve = ocp.to_function("step", [ocp.value(start), *plan], plan)
        self._places = plan[1].shape
        self._guess_of_plan: list[Any] = []

    def step(self, measured: Mapping[str, Any], t: float = 0.0) -> dict[str, float]:
        """The inputs that rockit gives."""
        x = self.whole_state(measured) / self.stages.sizes_x
        if not self.took:
            first = self._first(x, t)
            self._guess_of_plan = [first.x.T, np.zeros(self._places)]
            self._guess_of_plan[1][: self.stages.nu] = first.u.T
        begin = process_time()
        self._guess_of_plan = [np.asarray(one) for one in self._solve(x, *self._guess_of_plan)]
        self._newton.applied = self._guess_of_plan[1][: self.stages.nu, 0]
        self.took.append(process_time() - begin)
        self.status = "solved"
        return self.held

    def reset(self) -> None:
        """Begin anew, from the guess of the model."""
        super().reset()
        self.took = []

    def prepare(self) -> None:
        """rockit prepares nothing."""
