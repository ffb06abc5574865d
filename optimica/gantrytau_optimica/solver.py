"""Ipopt on a transcribed problem: from first guess and parameters to one immutable record."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from gantrytau_optimica.points import parameter_values
from gantrytau_optimica.trajectory import Trajectory
from gantrytau_optimica.transcription import Transcription, transcribe

Array = NDArray[np.float64]

STATUS = {
    "Solve_Succeeded": "solved",
    "Solved_To_Acceptable_Level": "solved to acceptable accuracy",
    "Infeasible_Problem_Detected": "infeasible",
    "Search_Direction_Becomes_Too_Small": "stuck: no progress",
    "Diverging_Iterates": "diverged",
    "User_Requested_Stop": "interrupted",
    "Feasible_Point_Found": "feasible point found",
    "Maximum_Iterations_Exceeded": "iteration limit reached",
    "Restoration_Failed": "restoration of feasibility failed",
    "Error_In_Step_Computation": "no step could be computed",
    "Maximum_CpuTime_Exceeded": "time limit reached",
    "Maximum_WallTime_Exceeded": "time limit reached",
    "Not_Enough_Degrees_Of_Freedom": "more equations than unknowns",
    "Invalid_Number_Detected": "a value is not a finite number",
}


@dataclass(frozen=True)
class Progress:
    """The state of a solve after an iteration."""

    iteration: int
    objective: float
    violation: float  # largest violation of a row of the program
    seconds: float


@dataclass(frozen=True)
class SolverOptions:
    """How to solve; the defaults serve smooth problems with good nominal values."""

    tolerance: float = 1e-8
    max_iterations: int = 3000
    max_seconds: float = 300.0
    ipopt: Mapping[str, Any] | None = None  # further options of Ipopt, which win


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Sensitivities of the objective to a limit, (n,), at times t (s); NaN for boundary conditions."""

    t: Array
    values: Array


@dataclass(frozen=True, eq=False)
class Solution:
    """What a solve found, solved or not."""

    transcription: Transcription
    parameters: Array
    variables: Array  # physical, in the order of the layout
    rows: Array  # values of the rows, in the units of their groups
    bound_multipliers: Array  # of the variables
    row_multipliers: Array
    objective: float
    iterations: int
    status: str
    success: bool
    build_seconds: float
    solve_seconds: float
    violation: float  # largest violation of a row or bound, in its unit
    stationarity: float  # Ipopt's final dual infeasibility, scaled

    @property
    def trajectory(self) -> Trajectory:
        """The signals as functions of time."""
        problem = self.transcription.problem
        free = self.variables[: len(problem.free)]
        start, final = self.transcription.horizon(free, self.parameters)
        return Trajectory(problem, self.transcription.layout, self.variables, self.parameters, start, final)

    @property
    def free(self) -> dict[str, float]:
        """The free numbers by name."""
        names = [number.name for number in self.transcription.problem.free]
        return dict(zip(names, self.variables[: len(names)].tolist(), strict=True))

    @property
    def multipliers(self) -> dict[str, Multipliers]:
        """By name: limits, boundary conditions, `der(x)`, residuals, bounds of signals and free numbers."""
        problem, layout = self.transcription.problem, self.transcription.layout
        trajectory = self.trajectory
        found: dict[str, Multipliers] = {}
        for i, x in enumerate(problem.signals):
            mine = np.flatnonzero(layout.owner == i)
            found[x.name] = self._multipliers(trajectory, layout.moment[mine], self.bound_multipliers[mine])
        for i, x in enumerate(problem.free):
            found[x.name] = self._multipliers(
                trajectory, np.array([np.nan]), self.bound_multipliers[i : i + 1]
            )
        for group in self.transcription.groups:
            name = f"continuity of {group.name}" if group.kind == "continuity" else group.name
            name = f"{name}, {group.moving} limit" if group.moving else name
            name = f"{name} (limit)" if name in found else name
            found[name] = self._multipliers(trajectory, group.moments, self.row_multipliers[group.rows])
        return found

    @staticmethod
    def _multipliers(trajectory: Trajectory, moments: Array, values: Array) -> Multipliers:
        return Multipliers(trajectory.start + moments * (trajectory.final - trajectory.start), values)

    def report(self) -> str:
        """What was found or, if the problem is unsolved, why not, in the words of the problem."""
        from gantrytau_optimica.failure import explain

        return explain(self)


class _Watch(ca.Callback):
    """Called by Ipopt after every iteration: reports progress, and stops the solve when asked to."""

    def __init__(self, variables: int, rows: int) -> None:
        ca.Callback.__init__(self)
        self.sizes = {"x": variables, "f": 1, "g": rows, "lam_x": variables, "lam_g": rows, "lam_p": 0}
        self.report: Callable[[Progress], None] | None = None
        self.bounds: tuple[Array, Array] = (np.zeros(0), np.zeros(0))
        self.iterate: Array | None = None
        self.failure: BaseException | None = None
        self.stop = False
        self.count = 0
        self.began = 0.0
        self.construct("watch", {})

    def get_n_in(self) -> int:
        return ca.nlpsol_n_out()

    def get_n_out(self) -> int:
        return 1

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        size = self.sizes[ca.nlpsol_out(i)]
        return ca.Sparsity.dense(size, 1) if size else ca.Sparsity(0, 1)

    def eval(self, arg: list[ca.DM]) -> list[int]:
        self.iterate = np.asarray(arg[0]).ravel()
        try:
            if self.report is not None:
                g = np.asarray(arg[2]).ravel()
                violation = float(np.max(np.concatenate([self.bounds[0] - g, g - self.bounds[1], [0.0]])))
                self.report(Progress(self.count, float(arg[1]), violation, time.perf_counter() - self.began))
        except BaseException as error:  # must not travel through Ipopt; raised again after the solve
            self.failure, self.stop = error, True
        self.count += 1
        return [int(self.stop)]


class Solver:
    """Ipopt prepared for one transcription, to be used for many parameters and first guesses."""

    def __init__(self, transcription: Transcription, options: SolverOptions = SolverOptions()) -> None:
        began = time.perf_counter()
        self.transcription = transcription
        program = transcription.program
        self._watch = _Watch(program.variables, program.rows)
        ipopt = {
            "print_level": 0,
            "sb": "yes",
            "linear_solver": "mumps",
            "mu_strategy": "adaptive",
            "tol": options.tolerance,
            "max_iter": options.max_iterations,
            "max_wall_time": options.max_seconds,
            **(options.ipopt or {}),
        }
        self._nlpsol = ca.nlpsol(
            "solver",
            "ipopt",
            program.nlp,
            {
                "ipopt": ipopt,
                "print_time": False,
                "calc_lam_p": False,
                "show_eval_warnings": False,
                "grad_f": program.grad_f,
                "jac_g": program.jac_g,
                "hess_lag": program.hess_lag,
                "iteration_callback": self._watch,
            },
        )
        self.build_seconds = transcription.seconds + time.perf_counter() - began

    def solve(
        self,
        parameters: Mapping[str, Any] | None = None,
        *,
        guess: Mapping[str, Any] | Solution | None = None,
        progress: Callable[[Progress], None] | None = None,
    ) -> Solution:
        """Solve for parameters by name; guess as in `Transcription.first_guess`, or a solution on the same
        mesh.

        An interrupt (Ctrl-C, or KeyboardInterrupt from `progress`) ends the solve with status "interrupted"
        and the last iterate; any other error from `progress` is raised.
        """
        t, began = self.transcription, time.perf_counter()
        p = parameter_values(t.problem, parameters)
        start = guess.variables if isinstance(guess, Solution) else t.first_guess(p, guess)
        lower, upper = (side / t.nominal for side in t.variable_bounds.at(p))
        row_lower, row_upper = t.row_bounds.at(p)
        self._require_room(lower, upper, row_lower, row_upper)
        watch = self._watch
        watch.report, watch.bounds, watch.began = progress, (row_lower, row_upper), began
        watch.failure, watch.stop, watch.count, watch.iterate = None, False, 0, None
        with _interruptible(watch):
            found = self._nlpsol(
                x0=start / t.nominal, p=p, lbx=lower, ubx=upper, lbg=row_lower, ubg=row_upper
            )
        if watch.failure is not None and not isinstance(watch.failure, KeyboardInterrupt):
            raise watch.failure
        return self._record(found, start, p, time.perf_counter() - began)

    def _require_room(self, lower: Array, upper: Array, row_lower: Array, row_upper: Array) -> None:
        t = self.transcription
        for i in np.flatnonzero(lower > upper)[:1]:
            owner = t.layout.owner[i]
            name = t.problem.signals[owner].name if owner >= 0 else t.problem.free[i].name
            raise ValueError(
                f"{name}: lower limit {lower[i] * t.nominal[i]:.6g} is above "
                f"upper limit {upper[i] * t.nominal[i]:.6g}"
            )
        for group in t.groups:
            if (row_lower[group.rows] > row_upper[group.rows]).any():
                raise ValueError(f"{group.name}: its lower limit is above its upper limit")

    def _record(self, found: Mapping[str, ca.DM], start: Array, p: Array, seconds: float) -> Solution:
        t, stats = self.transcription, self._nlpsol.stats()
        name = "User_Requested_Stop" if self._watch.stop else stats["return_status"]
        scaled = np.asarray(found["x"]).ravel()
        if not np.isfinite(scaled).all():
            scaled = self._watch.iterate if self._watch.iterate is not None else start / t.nominal
        f, g = t.program.nlp(scaled, p)
        rows = np.asarray(g).ravel()
        multipliers = np.asarray(found["lam_g"]).ravel()
        scale = np.ones(len(rows))
        for group in t.groups:
            scale[group.rows] = group.scale
        lower, upper = t.row_bounds.at(p)
        low, high = t.variable_bounds.at(p)
        variables = scaled * t.nominal
        excess = np.concatenate(
            [(lower - rows) / scale, (rows - upper) / scale, low - variables, variables - high, [0.0]]
        )
        duals = (stats.get("iterations") or {}).get("inf_du") or [np.nan]
        return Solution(
            transcription=t,
            parameters=p,
            variables=variables,
            rows=rows / scale,
            bound_multipliers=np.asarray(found["lam_x"]).ravel() / t.nominal,
            row_multipliers=multipliers * scale,
            objective=float(f),
            iterations=int(stats["iter_count"]),
            status=STATUS.get(name, name.replace("_", " ").lower()),
            success=name in ("Solve_Succeeded", "Solved_To_Acceptable_Level"),
            build_seconds=self.build_seconds,
            solve_seconds=seconds,
            violation=float(np.max(excess)),
            stationarity=float(duals[-1]),
        )


@contextmanager
def _interruptible(watch: _Watch) -> Iterator[None]:
    """Ctrl-C asks the solve to stop after the running iteration; a second one raises as usual."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.getsignal(signal.SIGINT)

    def ask(*_: object) -> None:
        watch.stop = True
        signal.signal(signal.SIGINT, before)

    signal.signal(signal.SIGINT, ask)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def solve(
    transcription: Transcription,
    parameters: Mapping[str, Any] | None = None,
    *,
    guess: Mapping[str, Any] | Solution | None = None,
    options: SolverOptions = SolverOptions(),
    progress: Callable[[Progress], None] | None = None,
) -> Solution:
    """Solve a transcribed problem once.

    Where a point at a time that depends on free numbers has left its element, the problem is transcribed and
    solved again from the solution, at most five times.
    """
    solution = Solver(transcription, options).solve(parameters, guess=guess, progress=progress)
    for _ in range(5):
        t, free = solution.transcription, solution.free
        if not solution.success or not any(
            place.strayed(t.layout, np.array(list(free.values())), solution.parameters) for place in t.places
        ):
            break
        t = transcribe(
            t.problem,
            t.layout.borders,
            points=len(t.layout.scheme.points),
            scheme_name=t.layout.scheme.name,
            controls=t.controls,
            located=free,
        )
        solution = Solver(t, options).solve(parameters, guess=solution, progress=progress)
    return solution
