"""The robot as an FMU made by PythonFMU: an FMI 2.0 slave in Python that integrates the same equations.

It stands alone: PythonFMU copies this file into the FMU and runs it there, beside `robot.npz` with the state at the
start (6,) = tool position and velocity, and the tolerance; `rates.casadi`, state and forces -> rates; and
`step.casadi`, state, forces, step size -> state after one step of the classical Runge-Kutta method of order 4.
Where the tolerance is 0 a communication step is one fixed step in one call of CasADi, without control of its
error; else it is integrated by scipy's RK45, Dormand and Prince's method, with the absolute tolerance 1e-3 of it.
"""

from pathlib import Path

import casadi as ca
import numpy as np
from pythonfmu import Fmi2Causality, Fmi2Slave, Real  # pyright: ignore[reportMissingImports]
from scipy.integrate import solve_ivp


class PythonRobot(Fmi2Slave):
    """Inputs: forces f0 to f2, N. Outputs: tool position x0 to x2, m, and velocity x3 to x5, m/s."""

    def __init__(self, **settings):
        super().__init__(**settings)
        folder = Path(self.resources or Path(__file__).parent)
        self.rates = ca.Function.load(str(folder / "rates.casadi"))
        self.step = ca.Function.load(str(folder / "step.casadi"))
        with np.load(folder / "robot.npz") as found:
            start, self.tolerance = found["start"].tolist(), float(found["tolerance"])
        self.f0 = self.f1 = self.f2 = 0.0
        self.x0, self.x1, self.x2, self.x3, self.x4, self.x5 = start
        for k in range(3):
            self.register_variable(Real(f"f{k}", causality=Fmi2Causality.input))
        for k in range(6):
            self.register_variable(Real(f"x{k}", causality=Fmi2Causality.output))

    def do_step(self, current_time: float, step_size: float) -> bool:
        state = [self.x0, self.x1, self.x2, self.x3, self.x4, self.x5]
        forces = [self.f0, self.f1, self.f2]
        if self.tolerance:
            after = (
                solve_ivp(
                    lambda _, x: self.rates(x, forces).full().ravel(),
                    (0.0, step_size),
                    state,
                    method="RK45",
                    t_eval=[step_size],
                    rtol=self.tolerance,
                    atol=1e-3 * self.tolerance,
                )
                .y[:, -1]
                .tolist()
            )
        else:
            after = self.step(state, forces, step_size).nonzeros()
        self.x0, self.x1, self.x2, self.x3, self.x4, self.x5 = after
        return True
