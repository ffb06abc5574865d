"""`Mpc`: an optimal-control problem solved anew at every sample, over a horizon that recedes."""

import math
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from typing import Any, Literal

import numpy as np

from gantrytau import ModelError, Result
from gantrytau.border.checks import array, instance, number, one_of, whole
from gantrytau.border.refusal import Given, did_you_mean
from gantrytau_optimica.answers.answer import Answer
from gantrytau_optimica.control.build import build
from gantrytau_optimica.control.control_problem import ControlProblem
from gantrytau_optimica.predictive.closed_loop import PARTS, ClosedLoop, closed_loop
from gantrytau_optimica.predictive.horizon_qp import Found, HorizonProgram, Stage
from gantrytau_optimica.predictive.plan import (
    PlannedMotion,
    StepTimes,
    first_plan,
    guessed_plan,
    motion_result,
)
from gantrytau_optimica.predictive.stages import HorizonStages, Linear
from gantrytau_optimica.predictive.terminal import SteadyState, Terminal
from gantrytau_optimica.problem.optimization import Optimization
from gantrytau_optimica.problem.read_problem import read_problem

Status = Literal["solved", "not converged", "late", "lost", "failed"]
STANDS = 1e-6  # changes of scaled inputs by which iterations are done; flat parts of a program are not solved better
PENALTY = 1e3  # times the largest curvature of the objective
MOST = 50  # iterations of the first plan, and of `converged`


class Mpc:
    """Model predictive control by a problem's objective and constraints, over a horizon of `elements` periods.

    problem: a subclass of Optimization or an instance, with a fixed end time, which the horizon replaces, and no events.
    period: s, between two samples, over which inputs are held; elements: periods of the horizon.
    hard: words of limits along the path that are never softened, "all", or "none" (the default). Limits of inputs are always
    hard; soft ones give way, by an exact penalty, where no plan keeps them.
    penalty: of the objective for passing a limit by its size; default: 1e3 times the largest curvature of the objective.
    terminal: "lqr" adds the cost of holding the state at rest that costs least for ever (Riccati), None adds nothing but
    the problem's own objective at its end.
    iterations: of Gauss-Newton's method at a step: 1 is real-time iteration (Diehl, Bock, Schloeder, 2005); "converged":
    until nothing changes. delay: periods from a measurement until its inputs are applied, 0 or 1; the state is foretold to
    then.
    deadline: s, of a step: if it takes longer, the inputs are those of the plan before, and `.status` says "late".
    guess: a first plan: an Optimum or Result of the same names, or name -> number or function of time.
    Raises ModelError for what a receding horizon cannot be: free numbers, conditions in the middle, events.
    """

    def __init__(
        self,
        problem: Optimization | type[Optimization],
        *,
        period: float,
        elements: int = 20,
        hard: str | Sequence[str] = "none",
        penalty: float | None = None,
        terminal: Literal["lqr"] | None = None,
        iterations: int | Literal["converged"] = 1,
        delay: int = 0,
        deadline: float | None = None,
        guess: Mapping[str, Any] | Result | Answer | None = None,
    ):
        self.period = number("Mpc", "period", period, unit="s", above=0.0)
        self.elements = whole("Mpc", "elements", elements, least=1)
        self.delay = whole("Mpc", "delay", delay, least=0, most=1)
        self.deadline = number(
            "Mpc", "deadline", math.inf if deadline is None else deadline, unit="s", above=0.0, most=math.inf
        )
        self._converged = iterations == "converged"
        self.iterations = whole("Mpc", "iterations", MOST if self._converged else iterations, least=1)
        if terminal is not None:
            one_of("Mpc", "terminal", terminal, ("lqr",))
        if penalty is not None:
            penalty = number("Mpc", "penalty", penalty, above=0.0)
        self.built, self._stages = _staged(problem, self.period)
        self.name = self.built.read.name
        self._yielding = soft = self._soft(hard)
        weight = PENALTY * self._stages.curvature if penalty is None else penalty
        finite = np.isfinite(self._stages.rows)
        self._program = HorizonProgram(self.elements, self._stages.nx, self._stages.nu, soft, finite, weight)
        self._terminal = Terminal(self._stages)
        self._steady = SteadyState(self._stages) if terminal == "lqr" else None
        self._guess = guess
        self._plan: PlannedMotion | None = None
        self._prepared: tuple[PlannedMotion, Linear | None] | None = None
        self._preparations: list[float] = []
        self._steps: list[float] = []
        self._missed = 0
        self.status: Status | None = None
        self.softened: tuple[str, ...] = ()  # limits that the last plan passes
        self._applied = np.clip(np.zeros(self._stages.nu), self._stages.lower_u, self._stages.upper_u)

    def __repr__(self) -> str:
        counts = f"{self._stages.nx} states, {self._stages.nu} inputs"
        return f"<Mpc {self.name}: {self.elements} periods of {self.period:g} s, {counts}>"

    @cached_property
    def states(self) -> tuple[str, ...]:
        """Names of the states, all of which `step` wants."""
        return tuple(s.name for s in self._stages.phase.states)

    @cached_property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs that `step` gives."""
        return tuple(s.name for s in self._stages.phase.inputs)

    @property
    def timing(self) -> StepTimes:
        """What all steps took until now."""
        return StepTimes(tuple(self._preparations), tuple(self._steps), self._missed)

    @property
    def plan(self) -> Result:
        """All variables of the model over the horizon as planned at the last step, inputs as they are held."""
        if self._plan is None:
            raise ModelError("there is no plan before the first step", place=self.name)
        return motion_result(self.built, self._stages, self._plan, self.period, f"{self.name}, planned")

    def step(self, measured: Mapping[str, Any], t: float = 0.0) -> dict[str, float]:
        """The inputs to hold from now on, with delay=1 from the next sample on, by name.

        measured: the state by names, at time t in s. What is not finite is taken as the plan foretold it, and `.status` says
        "lost". ModelError for names that are no states, and for a first measurement that is not finite.
        """
        begin = time.perf_counter()
        x, lost = self._state(measured)
        if self.delay:
            (x, foretold), t = self._later(x, t), t + self.period
            lost |= foretold
        before = self._plan
        plan, solved, change = self._iterated(x, t)
        late = before is not None and time.perf_counter() - begin > self.deadline
        kept = plan if before is None else before.shifted(t, self.period)
        self._plan = plan if solved else None if before is None else kept
        held = kept.u[0] if late or not solved else plan.u[0]
        self._applied = np.clip(held, self._stages.lower_u, self._stages.upper_u)
        self._missed += late
        wanting = self._converged and change >= STANDS
        words: dict[Status, bool] = {
            "failed": not solved,
            "late": late,
            "lost": lost,
            "not converged": wanting,
            "solved": True,
        }
        self.status = next(word for word, holds in words.items() if holds)
        self._steps.append(time.perf_counter() - begin)
        return self.held

    def _iterated(self, x: np.ndarray, t: float) -> tuple[PlannedMotion, bool, float]:
        """The plan from a state (nx,), whether its programs were solved, and the last change of its inputs.

        A plan that cannot go on, or is no motion of the model, is made anew as the first one.
        """
        prepared, self._prepared = self._prepared, None
        if self._plan is not None:
            if prepared is not None and abs(prepared[0].t - t) < 1e-9 * self.period:
                plan, linear = prepared
            else:
                plan = self._plan.shifted(t, self.period)
                linear = self._linear(plan)
            # how far the unknowns are from solving their equations, beside what they are
            if linear is not None and np.abs(linear.w[:, :, 0]).max() < 1.0 + np.abs(plan.w).max():
                found = self._improved(plan, linear, x, self.iterations)
                if found[1]:
                    return found
        first = self._first(x, t)
        return self._improved(first, self._linear(first), x, MOST)

    def _improved(
        self, plan: PlannedMotion, linear: Linear | None, x: np.ndarray, most: int
    ) -> tuple[PlannedMotion, bool, float]:
        """A plan after at most so many iterations, as `_iterated`; linear: at the plan, its program loaded."""
        change = math.inf
        for k in range(most):
            linear = self._linear(plan) if k else linear
            found = None if linear is None else self._program.solve(x - plan.x[0])
            if linear is None or found is None or not found.solved:
                return plan, False, change
            plan, change = plan.changed(linear, found), float(np.abs(found.u).max(initial=0.0))
            self.softened = self._passed(found)
            if change < STANDS:
                break
        return plan, True, change

    def prepare(self) -> None:
        """What can be done before the next measurement: the plan shifted by a period, linearised, its program loaded."""
        begin = time.perf_counter()
        if self._plan is not None:
            plan = self._plan.shifted(self._plan.t + self.period, self.period)
            self._prepared = plan, self._linear(plan)
        self._preparations.append(time.perf_counter() - begin)

    def _linear(self, plan: PlannedMotion) -> Linear | None:
        """The horizon linearised at a plan, its program loaded; None where a number is not finite."""
        stages, times = self._stages, plan.t + self.period * np.arange(self.elements)
        linear = stages.linear(plan.x[:-1], plan.w, plan.u, times)
        if linear is None:
            return None
        lower, upper = stages.rows
        H, g = self._terminal.added(linear, plan)
        P, p = np.zeros((stages.nx, stages.nx)), np.zeros(stages.nx)
        if self._steady is not None:
            P, rest = self._steady.at(plan.t + self.elements * self.period, plan.x[-1])
            p = P @ (plan.x[-1] - rest)
        stage = Stage(
            H, g, linear.A, linear.B, linear.b - plan.x[1:], linear.C, linear.D, lower - linear.r, upper - linear.r,
            stages.lower_u - plan.u, stages.upper_u - plan.u,
        )  # fmt: skip
        self._program.load(stage, P, p)
        return linear

    def compiled(self) -> bool:
        """Wait until the model is machine code, which a long run has made beside it; False without a C compiler."""
        return self._stages.compiled()

    def reset(self) -> None:
        """Forget the plan: the next step makes a first one."""
        self._plan = self._prepared = None
        self._applied = np.clip(np.zeros(self._stages.nu), self._stages.lower_u, self._stages.upper_u)

    def run(
        self,
        plant: Optimization | type[Optimization] | None = None,
        *,
        stop: float,
        start: Mapping[str, Any] | None = None,
        noise: Mapping[str, float] | None = None,
        seed: int = 0,
    ) -> ClosedLoop:
        """The loop closed with a plant, from a new plan on.

        plant: the same problem with other parameters, by default with the same; stop: s; start: state -> value, by default
        the model's start; noise: state -> standard deviation of its measurement, in its unit.
        """
        self.reset()
        self._preparations, self._steps, self._missed = [], [], 0
        step = self.period / PARTS
        other = (
            _staged(plant, step)
            if plant is not None
            else (self.built, HorizonStages(self.built.problem, step))
        )
        return closed_loop(self, other, stop, start or {}, noise or {}, seed)

    @property
    def held(self) -> dict[str, float]:
        """The inputs that are applied now, by name."""
        return dict(zip(self.inputs, (self._applied * self._stages.sizes_u).tolist(), strict=True))

    def whole_state(self, values: Mapping[str, Any]) -> np.ndarray:
        """All states in their units, in the order of `states`; errors of `step`."""
        return self._state(values)[0] * self._stages.sizes_x

    def _state(self, measured: Mapping[str, Any]) -> tuple[np.ndarray, bool]:
        """The measured state, scaled, and whether a part of it was not finite."""
        instance(
            self.name, "measured", measured, Mapping, "a mapping from the names of states to their values"
        )
        whole = [measured.get(name) for name in self.states]
        plain = len(measured) == len(whole) and all(type(value) is float for value in whole)
        x = np.array(whole if plain else self._named(measured), dtype=float) / self._stages.sizes_x
        lost = not np.isfinite(x).all()
        if lost:
            if self._plan is None:
                raise ModelError("the first measurement is not finite, expected numbers", place=self.name)
            foretold = self._plan.x[0 if self.delay else 1]
            x = np.where(np.isfinite(x), x, foretold)
        return x, lost

    def _named(self, measured: Mapping[str, Any]) -> list[float]:
        """The elements of all states, from names of scalars and vectors."""
        flat, found = self.built.read.dae.flat, {}
        for name, value in measured.items():
            elements = flat.expand(name)
            unknown = [one for one in elements if one not in self.states]
            if unknown:
                words = f"expected the states {', '.join(self.states)}{did_you_mean(unknown[0], self.states)}"
                raise ModelError(words, place=self.name, found=Given("measured", name))
            shape = (len(elements),) if len(elements) > 1 else ()
            values = array(self.name, name, value, shape, finite=False)
            found.update(zip(elements, np.ravel(values), strict=True))
        missing = [name for name in self.states if name not in found]
        if missing:
            words = f"measured lacks {', '.join(missing)}, expected all of {', '.join(self.states)}"
            raise ModelError(words, place=self.name)
        return [found[name] for name in self.states]

    def _later(self, x: np.ndarray, t: float) -> tuple[np.ndarray, bool]:
        """The state a period later with the inputs held that are applied now, and whether only the plan tells it."""
        begins = [self._first(x, t)] if self._plan is None else [self._plan, self._first(x, t)]
        for begin in begins:
            with suppress(ModelError):
                return self._stages.moved(x, begin.w[0], self._applied, t)[self._stages.last], False
        if self._plan is None:
            raise ModelError("the motion from the first measurement has no solution", place=self.name)
        return self._plan.x[1], True

    def _first(self, x: np.ndarray, t: float) -> PlannedMotion:
        """A plan to begin with: at rest, or the guess."""
        plan = first_plan(self._stages, self.elements, x, t)
        return plan if self._guess is None else guessed_plan(self._stages, plan, self._guess)

    def _soft(self, hard: str | Sequence[str]) -> np.ndarray:
        """Which rows of a stage are soft."""
        names = self._stages.row_names
        if isinstance(hard, str):
            one_of("Mpc", "hard", hard, ("none", "all"))
            return np.full(len(names), hard == "none")
        unknown = [name for name in hard if name not in names]
        if unknown:
            words = f"expected some of {', '.join(dict.fromkeys(names)) or 'no limit'}{did_you_mean(unknown[0], names)}"
            raise ModelError(words, place=self.name, found=Given("hard", unknown[0]))
        return np.array([name not in hard for name in names], dtype=bool)

    def _passed(self, found: Found) -> tuple[str, ...]:
        """Words of the soft limits, where the plan passes one."""
        passed = zip(self._stages.row_names, self._yielding & np.any(found.slack > 1e-6), strict=True)
        return tuple(dict.fromkeys(name for name, so in passed if so))


def _staged(problem: Any, period: float) -> tuple[Any, HorizonStages]:
    """The problem in states, algebraics and inputs, and its stages; ModelError for what no receding horizon can have."""
    read = read_problem(problem)
    built = build(read, {}, (), {}, "forward")
    found: ControlProblem = built.problem
    if len(found.phases) > 1:
        raise ModelError("phases are not for a receding horizon, expected one problem", place=read.name)
    if found.free:
        names = ", ".join(n.name for n in found.free)
        raise ModelError(
            f"{names} is free, expected a number: a receding horizon has a fixed length and a fixed model; give it a value, "
            "as in final_time = 1.0",
            place=read.name,
        )
    if not any(phase.inputs for phase in found.phases):
        raise ModelError("there is no input to choose; declare one as Input", place=read.name)
    return built, HorizonStages(found, period)
