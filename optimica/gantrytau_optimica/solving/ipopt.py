"""Ipopt on a transcribed problem: progress, interruption, and statuses in words."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import casadi as ca
import numpy as np

from gantrytau.describing.record import Record
from gantrytau_optimica.solving.clock import Clock, Progress
from gantrytau_optimica.solving.interruptible import Watch, attended
from gantrytau_optimica.transcription.program import Program

WORDS = {
    "Solve_Succeeded": "solved",
    "Solved_To_Acceptable_Level": "solved to a lower accuracy than asked for",
    "Infeasible_Problem_Detected": "no solution: the limits contradict each other",
    "Search_Direction_Becomes_Too_Small": "stuck: steps became too small",
    "Diverging_Iterates": "diverging: the problem may be unbounded",
    "User_Requested_Stop": "interrupted",
    "Maximum_Iterations_Exceeded": "iteration limit reached",
    "Maximum_CpuTime_Exceeded": "time limit reached",
    "Maximum_WallTime_Exceeded": "time limit reached",
    "Restoration_Failed": "stuck: no way back to the limits was found",
    "Error_In_Step_Computation": "stuck: no search direction was found",
    "Invalid_Number_Detected": "stuck: an expression is not finite",
    "Not_Enough_Degrees_Of_Freedom": "more conditions than unknowns",
}
NOT_BEGUN = "not begun: an expression is not finite at the first guess"
PUSH = 1e-2  # Ipopt's bound_push and bound_frac: how far a guess is moved inside of its limits

UNLIMITED = 1e200

# MUMPS' order of elimination by least degree with dense rows apart, as the duration stands in nearly all of them: on large
# meshes a linear solve takes a tenth to a third less than with Ipopt's own choice.
LEAST_DEGREE = 6

# The least pivot in equations of loops, as a part of the largest in its column: with Ipopt's own 1e-6 more
# steps are regularised, and five motions of the six-link robot took 261 iterations for 186.
LEAST_PIVOT = 1e-4

LAST = 3  # steps that tell whether a solution is a minimum
FAR = 1e5  # typical sizes that an unknown moves from its guess when it runs away

NEAR = {
    "mu_strategy": "monotone",
    "mu_init": 1e-4,
    "bound_push": 1e-5,
    "bound_frac": 1e-5,
    "slack_bound_push": 1e-5,
}
Barrier = Literal["adaptive", "patient", "near", "hot"]
BARRIERS: dict[Barrier, dict[str, Any]] = {
    "adaptive": {"mu_strategy": "adaptive"},
    # lowered by one law it cannot vanish long before the limits that bind are found
    "patient": {"mu_strategy": "monotone", "mu_init": 0.1},
    # from a solution nearby it begins low: begun high, it may lead to another branch
    "near": NEAR,
    # on a mesh that only follows the structure of a solution it may begin lower still
    "hot": NEAR | {"mu_init": 1e-6, "bound_push": 1e-6, "bound_frac": 1e-6, "slack_bound_push": 1e-6},
}

SLOPE = 1.0  # what the objective changes by when all unknowns change by their sizes: smaller ones are scaled up to it
STEEP = 1e2  # derivatives by one unknown are scaled down to this
FEW = 1e2  # times an objective of few unknowns is scaled up
ALONE = 3.0  # unknowns that share its gradient: fewer are few


@dataclass(frozen=True, eq=False)
class Solution(Record):
    """Unknowns w and multipliers as Ipopt left them; status in words; times in s.

    upright: whether its last steps were made without regularisation, so that curvature was positive in all directions
    that conditions leave free; held: whether positions rest on the limits that keep loops assembled as they are guessed.
    """

    w: np.ndarray
    multipliers: np.ndarray
    bound_multipliers: np.ndarray
    constraints: np.ndarray
    objective: float
    success: bool
    status: str
    iterations: int
    solve_time: float
    upright: bool = False
    held: bool = False


class Pressed(KeyboardInterrupt):
    """Ctrl-C while Ipopt was at work, which let go at the end of its iteration; solution: where it was."""

    def __init__(self, solution: Solution):
        super().__init__()
        self.solution = solution


@dataclass(frozen=True)
class SolverSettings:
    """How long and how closely Ipopt is to look: tolerance, iterations, s, and who is told."""

    tolerance: float = 1e-8
    max_iterations: int = 1000
    max_time: float = 300.0
    progress: Progress | None = None
    barrier: Barrier = "adaptive"
    firm: bool = True  # whether the limits shall count as much as an objective that is one unknown
    loops: bool = False  # whether unknowns are found by iteration, so that pivots matter


class Solver:
    """Ipopt with exact derivatives for one program; may be called again with other numbers and guesses."""

    def __init__(self, program: Program, settings: SolverSettings):
        assembled = program.assembled
        self.settings, self.program = settings, program
        options = {
            "print_time": False,
            "show_eval_warnings": False,
            "calc_lam_p": False,
            "ipopt": {
                "print_level": 0,
                "sb": "yes",
                **BARRIERS[settings.barrier],
                "linear_solver": "mumps",
                "mumps_pivot_order": LEAST_DEGREE,
                "tol": settings.tolerance,
                "max_iter": settings.max_iterations,
                "max_wall_time": settings.max_time,
                # in units of their own objectives may be of any size: what is scaled decides
                "dual_inf_tol": UNLIMITED,
                "compl_inf_tol": UNLIMITED,
            },
        }
        if settings.loops:
            options["ipopt"]["mumps_pivtol"] = LEAST_PIVOT
        options |= {"grad_f": assembled.grad_f, "jac_g": assembled.jac_g, "hess_lag": assembled.hess_lag}
        self.nlp, self.options = assembled.nlp, options
        self.watch: Watch | None = None

    def watched(self) -> Watch:
        """Of Ipopt, both made for the first solve, and anew where one was left that still uses the old ones."""
        if self.watch is None or self.watch.left:
            assembled = self.program.assembled
            scale = _objective_scale(self.program, FEW if self.settings.firm else 1.0)
            self.watch = Watch(assembled.variables, assembled.rows)
            options = self.options | {"iteration_callback": self.watch}
            options["ipopt"] = options["ipopt"] | {"obj_scaling_factor": scale}
            self.nlpsol = ca.nlpsol("optimum", "ipopt", self.nlp, options)
        return self.watch

    def unsolved(self, program: Program, guess: np.ndarray) -> Solution:
        """The guess as a solution that was not looked for, because there is none."""
        objective, found = program.assembled.nlp(guess / program.places.scale, [])
        status = WORDS["Infeasible_Problem_Detected"]
        return Solution(
            w=guess,
            multipliers=np.zeros(program.assembled.rows),
            bound_multipliers=np.zeros(program.assembled.variables),
            constraints=np.array(found).ravel(),
            objective=float(objective),
            success=False,
            status=status,
            iterations=0,
            solve_time=0.0,
        )

    def solve(self, program: Program, guess: np.ndarray, clock: Clock | None = None) -> Solution:
        """Solve the program, with its limits as they are now, from unknowns `guess` (unscaled).

        clock: of the call; by default a solve has one of its own. Raises Pressed when Ctrl-C is.
        """
        begin = time.perf_counter()
        first = pushed(program, guess)
        if not finite(program, first):
            return replace(self.unsolved(program, first), status=NOT_BEGUN)
        watch, scale = self.watched(), program.places.scale
        watch.begin(clock or Clock(self.settings.max_time, self.settings.progress))
        limits = dict(lbx=program.lbw, ubx=program.ubw, lbg=program.lbg, ubg=program.ubg)
        found: Mapping[str, Any] | None = attended(self.nlpsol, watch, dict(x0=guess / scale, **limits))
        if watch.error is not None:
            raise watch.error
        if found is None:
            stats: dict[str, Any] = dict(success=False, iter_count=watch.iteration)
            word = "User_Requested_Stop"
            found = watch.last
        else:
            stats = self.nlpsol.stats()
            word = str(stats["return_status"])
        if word == "User_Requested_Stop" and not watch.pressed:
            word = "Maximum_WallTime_Exceeded"
        status = WORDS.get(word, word.replace("_", " ").lower())
        if not found:  # left before its first iteration
            return _ended(replace(self.unsolved(program, first), status=status), watch, begin)
        moved = np.abs(np.array(found["x"]).ravel() - first / scale)
        if word.startswith("Maximum") and np.max(moved, initial=0.0) > FAR:
            status = WORDS["Diverging_Iterates"]
        solution = Solution(
            w=np.array(found["x"]).ravel() * scale,
            multipliers=np.array(found["lam_g"]).ravel(),
            bound_multipliers=np.array(found["lam_x"]).ravel() / scale,
            constraints=np.array(found["g"]).ravel(),
            # Ipopt has it with a last bit lost: scaled, and divided by the factor again
            objective=float(self.nlp(found["x"], ca.DM(0, 1))[0]),
            success=bool(stats["success"]),
            status=status,
            iterations=int(stats["iter_count"]),
            solve_time=0.0,
            upright=_upright(stats),
        )
        return _ended(solution, watch, begin)


def _upright(stats: Mapping[str, Any]) -> bool:
    """Whether the last steps were made without regularisation; the first entry tells of no step."""
    last = stats.get("iterations", {}).get("regularization_size", ())[1:][-LAST:]
    return len(last) > 0 and not any(last)


def _ended(solution: Solution, watch: Watch, begin: float) -> Solution:
    """The solution with its time; raises Pressed with it if Ctrl-C was."""
    solution = replace(solution, solve_time=time.perf_counter() - begin)
    if watch.pressed:
        raise Pressed(solution)
    return solution


def pushed(program: Program, guess: np.ndarray) -> np.ndarray:
    """The guess (unscaled) where Ipopt begins: some way inside of its limits."""
    scale, lower, upper = program.places.scale, program.lbw, program.ubw
    x, width = guess / scale, upper - lower
    with np.errstate(invalid="ignore"):
        low = lower + np.minimum(PUSH * np.maximum(1.0, np.abs(lower)), PUSH * width)
        high = upper - np.minimum(PUSH * np.maximum(1.0, np.abs(upper)), PUSH * width)
    x = np.where(np.isfinite(lower), np.maximum(x, low), x)
    return np.where(np.isfinite(upper), np.minimum(x, high), x) * scale


def finite(program: Program, w: np.ndarray) -> bool:
    """Whether objective, conditions and their first derivatives are finite numbers at unknowns w (unscaled)."""
    x, none, assembled = w / program.places.scale, ca.DM(0, 1), program.assembled
    parts = [*assembled.nlp(x, none), assembled.grad_f(x, none)[1], assembled.jac_g(x, none)[1]]
    return all(np.all(np.isfinite(np.array(part.nonzeros()))) for part in parts)


def objective_size(program: Program) -> float:
    """By how much the objective changes when all unknowns change by their sizes from the guess, to first order;
    from beside the guess, where its gradient vanishes there.
    """
    return float(np.sum(program.objective_gradient[1]))


def _objective_scale(program: Program, few: float) -> float:
    """A factor that makes an objective neither so flat that any point is taken for its optimum, nor so steep that none is.

    few: what an objective of few unknowns is scaled up by. The time of a motion is one unknown: what all limits together
    are worth is its derivative, each of them so little that the barrier vanishes long before those that bind are found.
    Ipopt by itself scales down what is steep at the guess, by no more than 1e8.
    """
    at_guess, gradient = program.objective_gradient
    size, steepest = float(np.sum(gradient)), float(np.max(gradient, initial=0.0))
    if size <= 0.0:
        return 1.0
    sharing = size**2 / float(np.sum(gradient**2))
    wanted = max(SLOPE * (few / sharing if sharing < ALONE else 1.0) / size, 1.0) * min(STEEP / steepest, 1.0)
    return wanted / max(min(STEEP / max(np.max(at_guess, initial=0.0), 1e-300), 1.0), 1e-8)
