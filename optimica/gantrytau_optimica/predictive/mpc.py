"""`Mpc`: an optimal-control problem solved anew at every sample, over a horizon that recedes."""

import math
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from typing import Any, Literal

import numpy as np

from gantrytau import ModelError, Result
from gantrytau.answers.sampled_code import SampledCode
from gantrytau.border.checks import instance, number, one_of, whole
from gantrytau.border.refusal import Given, did_you_mean
from gantrytau_optimica.answers.answer import Answer
from gantrytau_optimica.predictive import horizon_checks as checks
from gantrytau_optimica.predictive.c_code import controller_code
from gantrytau_optimica.predictive.compiled_horizon import compiled_horizon
from gantrytau_optimica.predictive.estimators.state_estimator import StateEstimator
from gantrytau_optimica.predictive.gauss_newton import STANDS, GaussNewton, Iterated, Loaded, failed
from gantrytau_optimica.predictive.loop.closed_loop import ClosedLoop
from gantrytau_optimica.predictive.loop.driven_loop import driven_loop
from gantrytau_optimica.predictive.loop.model_loop import PARTS, model_loop
from gantrytau_optimica.predictive.loop.mpc_block import MpcBlock, mpc_block
from gantrytau_optimica.predictive.loop.plant import DrivenPlant, check_problem
from gantrytau_optimica.predictive.loop.sensors import Sensors
from gantrytau_optimica.predictive.moves import Moves
from gantrytau_optimica.predictive.plan import (
    PlannedMotion,
    Status,
    StepTimes,
    first_plan,
    guessed_plan,
    motion_result,
)
from gantrytau_optimica.predictive.stages import HorizonStages
from gantrytau_optimica.predictive.terminal import SteadyState
from gantrytau_optimica.predictive.unknowns import named_values, staged
from gantrytau_optimica.problem.optimization import Optimization

PENALTY = 1e3  # times the largest curvature of the objective
PASSED = 1e-6  # of the size of a limit: less is rounding
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
    disturbance, parameters: names of inputs or outputs with a constant disturbance, and of parameters, whose estimates
    `step` takes beside the state; what was prepared before takes them a period later. There is no offset if as many
    disturbances are estimated as outputs are measured and the objective is least at the set point (Pannocchia, Rawlings,
    2003).
    guess: of the first plan: an Optimum or Result of the same names, or name -> number or function of time; by
    default it is at rest. Full steps lead on from there, or Ipopt does.
    Raises ModelError for what a receding horizon cannot be: free numbers, conditions in the middle, events, an objective
    without bound; warns of samples that are slow beside the model, and of a deadline that no step keeps.
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
        disturbance: Sequence[str] = (),
        parameters: Sequence[str] = (),
        rates: Mapping[str, Any] | None = None,
        step_penalty: Mapping[str, float] | None = None,
        blocks: int | Sequence[int] = 1,
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
        self.built, self.stages, self._estimates = staged(problem, self.period, disturbance, parameters)
        self._modelled = dict(self._estimates)  # those of the model
        self.name = self.built.read.name
        checks.check_bounded(self.stages)
        checks.doubt_samples(self.built, self.period)
        self._yielding = soft = self._soft(hard)
        weight = PENALTY * self.stages.curvature if penalty is None else penalty
        self.moves = moves = Moves(
            self.stages, self.elements, rates or {}, step_penalty or {}, blocks, self.built.read.dae.flat.unit
        )
        self.steady = SteadyState(self.stages) if terminal == "lqr" else None
        self._newton = GaussNewton(self.stages, self.elements, soft, weight, moves, self.steady)
        self.terminal, self._penalty = self._newton.terminal, weight
        self._guess = guess
        self._plan: PlannedMotion | None = None
        self._prepared: tuple[PlannedMotion, Loaded | None] | None = None
        self._preparations: list[float] = []
        self._steps: list[float] = []
        self._missed = 0
        self.status: Status | None = None
        self.softened: tuple[str, ...] = ()  # limits that the last plan passes

    def __repr__(self) -> str:
        counts = f"{self.stages.nx} states, {self.stages.nu} inputs"
        return f"<Mpc {self.name}: {self.elements} periods of {self.period:g} s, {counts}>"

    @cached_property
    def states(self) -> tuple[str, ...]:
        """Names of the states, all of which `step` wants."""
        return tuple(s.name for s in self.stages.phase.states)

    @cached_property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs that `step` gives."""
        return tuple(s.name for s in self.stages.phase.inputs)

    @property
    def estimated(self) -> tuple[str, ...]:
        """Names of disturbances and parameters that `step` takes beside the state."""
        return tuple(self._estimates)

    @property
    def timing(self) -> StepTimes:
        """What all steps took until now."""
        return StepTimes(tuple(self._preparations), tuple(self._steps), self._missed)

    @property
    def plan(self) -> Result:
        """All variables of the model over the horizon as planned at the last step, inputs as they are held."""
        if self._plan is None:
            raise ModelError("there is no plan before the first step", place=self.name)
        return motion_result(self.built, self.stages, self._plan, self.period, f"{self.name}, planned")

    def step(self, measured: Mapping[str, Any], t: float = 0.0) -> dict[str, float]:
        """The inputs to hold from now on, with delay=1 from the next sample on, by name.

        measured: the state by names, at time t in s, and estimates of what `.estimated` names, kept where they are left out.
        What is not finite is taken as the plan foretold it, and `.status` says "lost". ModelError for names that are no
        states, and for a first measurement that is not finite.
        """
        begin, t = time.perf_counter(), number(self.name, "t", t, unit="s")
        (x, lost), reached = self._state(measured), True
        if self.delay:
            x, reached = self._later(x, t)
            t += self.period
        before = self._plan
        found, near = self._iterated(x, t) if reached else (failed(self._first(x, t)), False)
        late = before is not None and time.perf_counter() - begin > self.deadline
        kept = found.plan
        if before is not None and (late or not found.solved):
            kept = before.shifted(t, self.period)
        self._plan = found.plan if found.solved else None if before is None else kept
        held = kept.u[0]
        held = self.moves.reached(held, self._newton.applied)
        self._newton.applied = np.clip(held, self.stages.lower_u, self.stages.upper_u)
        self._missed += late
        if found.solved:
            self.softened = self._passed(found.slack, found.plan)
        words: dict[Status, bool] = {
            "failed": not found.solved,
            "late": late,
            "lost": lost,
            "not converged": not near,
            "solved": True,
        }
        self.status = next(word for word, holds in words.items() if holds)
        self._steps.append(time.perf_counter() - begin)
        checks.doubt_deadline(self.name, self.deadline, self._steps, self._missed)
        return self.held

    def _iterated(self, x: np.ndarray, t: float) -> tuple[Iterated, bool]:
        """The plan from a state (nx,), and whether it is as near to converged as wanted.

        A plan that cannot go on, or is no motion of the model, is made anew as the first one, without Ipopt.
        """
        prepared, self._prepared = self._prepared, None
        if self._plan is not None:
            if prepared is not None and abs(prepared[0].t - t) < 1e-9 * self.period:
                plan, loaded = prepared
            else:
                plan = self._plan.shifted(t, self.period)
                loaded = self._newton.load(plan)
            near = loaded is not None and plan.near(loaded.missed, x)
            if near and (found := self._newton.improved(plan, loaded, x, self.iterations)).solved:
                return found, found.stands or not self._converged
        found = self._begun(self._first(x, t), x)
        return found, found.stands or (found.near and not self._converged)

    def _begun(self, first: PlannedMotion, x: np.ndarray) -> Iterated:
        """The plan from a first one."""
        initial = self._plan is None
        found = self._newton.begun(first, x, MOST, initial)
        if initial and (found.solved or found.unbounded):
            checks.check_plan(self.stages, found.plan, found.unbounded)
        return found

    def prepare(self) -> None:
        """What can be done before the next measurement: the plan shifted by a period, linearised, its program loaded."""
        begin = time.perf_counter()
        if self._plan is not None:
            plan = self._plan.shifted(self._plan.t + self.period, self.period)
            self._prepared = plan, self._newton.load(plan)
        self._preparations.append(time.perf_counter() - begin)

    def compiled(self) -> bool:
        """Wait until the controller is machine code; False without a C compiler.

        The model becomes that in a long run anyway; the quadratic program only here, and where `c_code` can be had.
        """
        with suppress(ModelError):
            self._newton.code = compiled_horizon(self.c_code(), self.stages, self.elements)
        return self.stages.compiled()

    def reset(self) -> None:
        """Forget the plan and the estimates: the next step makes a first one."""
        self._plan = self._prepared = None
        self._estimates |= self._modelled
        self._newton.reset()

    def run(
        self,
        plant: Optimization | type[Optimization] | DrivenPlant | None = None,
        *,
        stop: float,
        start: Mapping[str, Any] | None = None,
        noise: Mapping[str, Any] | None = None,
        seed: int = 0,
        estimator: StateEstimator | None = None,
        after: ClosedLoop | None = None,
        wires: Mapping[str, str] | None = None,
    ) -> ClosedLoop:
        """The loop closed with a plant, from a new plan on.

        plant: the same problem with other parameters, by default with the same, or a `Controller` of gantrytau_fmu, which
        runs an FMU, any model or hardware from its own start; wires: input or state -> name in it. stop: s; start: state ->
        value, by default the model's start; noise: state -> standard deviation of its measurement, in its unit. estimator:
        a MovingHorizon or an ExtendedKalman, which begins anew; then what it names as measured is all that is, with noise by
        these names.
        after: a loop with the same model and estimator, to go on from where it ended, as if it had never ended.
        """
        sensors = Sensors(self, noise or {}, seed, estimator)
        self.recall(None)
        step = self.period / PARTS
        if isinstance(plant, DrivenPlant):
            return driven_loop(self, plant, stop, sensors, wires, start or after)
        check_problem(plant, wires)
        own = plant is None
        other = (self.built, HorizonStages(self.built.problem, step)) if own else staged(plant, step)[:2]
        return model_loop(self, other, stop, start or {}, sensors, after)

    def component(self) -> MpcBlock:
        """The controller as a component of models, for `simulate`; each run of it begins with a new plan.

        Its inputs are states and estimates, its outputs inputs of the plant: `connect(self.control.p, self.pole.p)`, or all
        but estimates by their names, `yield from self.control.wired(pole=self.pole)`.
        """
        return mpc_block(self)

    @property
    def memory(self) -> Any:
        """What a step takes from those before it."""
        return self._plan, self._newton.applied, dict(self._estimates)

    def recall(self, memory: Any) -> None:
        """Be as with this memory; None: as before the first step, with no times taken."""
        if memory is None:
            self.reset()
            self._preparations, self._steps, self._missed = [], [], 0
            return
        self._prepared = None
        self._plan, self._newton.applied, estimates = memory
        self._estimates |= estimates

    @property
    def key(self) -> tuple[Any, ...]:
        """What a loop must have in common with this controller to go on with it."""
        return self.states, self.inputs, self.period, self.elements, self.delay

    def resume(self, memory: Any, times: StepTimes) -> None:
        """Be as after the steps that left this memory."""
        self.recall(memory)
        self.prepare()
        self._preparations, self._steps = list(times.preparation), list(times.step)
        self._missed = times.missed

    def planned_motion(self, x: np.ndarray, t: float) -> PlannedMotion:
        """The plan of the last step; where there is none, rest in a state (nx,) in its units from t on."""
        return self._first(x / self.stages.sizes_x, t) if self._plan is None else self._plan

    def c_code(self) -> SampledCode:
        """The controller as C without heap, for boards and FMUs: `.write(folder)`. Its first step is at time 0.

        It gives the inputs of `step` without a deadline, from the state, then what `.estimated` names; what is not finite is
        foretold, or kept; first plans are not made by Ipopt.
        ModelError for courses, and for terminal="lqr" with a state of rest that moves.
        """
        unknown = self._first(np.full(self.stages.nx, np.nan), self.delay * self.period)
        limits = MOST, self.iterations, STANDS
        return controller_code(self, self._yielding, self._penalty, unknown, limits, self._estimates)

    @property
    def held(self) -> dict[str, float]:
        """The inputs that are applied now, by name."""
        return dict(zip(self.inputs, (self._newton.applied * self.stages.sizes_u).tolist(), strict=True))

    def whole_state(self, values: Mapping[str, Any]) -> np.ndarray:
        """All states in their units, in the order of `states`; errors of `step`."""
        return self._state(values)[0] * self.stages.sizes_x

    def _state(self, measured: Mapping[str, Any]) -> tuple[np.ndarray, bool]:
        """The measured state, scaled, and whether a part of it was not finite."""
        instance(self.name, "measured", measured, Mapping, "values by name")
        whole = [measured.get(name) for name in self.states]
        plain = len(measured) == len(whole) and all(type(value) is float for value in whole)
        x = np.array(whole if plain else self._named(measured), dtype=float) / self.stages.sizes_x
        lost = not np.isfinite(x).all()
        if lost:
            if self._plan is None:
                raise ModelError("the first measurement is not finite, expected numbers", place=self.name)
            foretold = self._plan.x[0 if self.delay else 1]
            x = np.where(np.isfinite(x), x, foretold)
        return x, lost

    def _named(self, measured: Mapping[str, Any]) -> list[float]:
        """The elements of all states; estimates are kept."""
        names = (*self.states, *self.estimated)
        found = named_values(self.built.read.dae.flat, self.name, "measured", measured, names, finite=False)
        self._estimates |= {
            name: found[name] for name in self.estimated if math.isfinite(found.get(name, math.nan))
        }
        missing = [name for name in self.states if name not in found]
        if missing:
            words = f"measured lacks {', '.join(missing)}, expected all of {', '.join(self.states)}"
            raise ModelError(words, place=self.name)
        return [found[name] for name in self.states]

    def _later(self, x: np.ndarray, t: float) -> tuple[np.ndarray, bool]:
        """The state a period later with the inputs held that are applied now, and whether the motion goes there."""
        plan, nx = self._first(x, t), self.stages.nx
        known = plan if self._plan is None else self._plan
        still = known.w[0].reshape(2, -1).copy()
        still[:, :nx] = x
        for begin in (still.ravel(), known.w[0], plan.w[0]):
            with suppress(ModelError):
                return self.stages.moved(x, begin, self._newton.applied, t)[self.stages.last], True
        return x, False

    def _first(self, x: np.ndarray, t: float) -> PlannedMotion:
        """A plan to begin with: at rest, or the guess."""
        plan = first_plan(self.stages, self.elements, x, t)
        return plan if self._guess is None else guessed_plan(self.stages, plan, self._guess)

    def _soft(self, hard: str | Sequence[str]) -> np.ndarray:
        """Number of the slack of each row of a stage, the one of its limit; -1 for a hard row."""
        names = self.stages.row_names
        if isinstance(hard, str):
            one_of("Mpc", "hard", hard, ("none", "all"))
            hard = names if hard == "all" else ()
        unknown = [name for name in hard if name not in names]
        if unknown:
            words = f"expected some of {', '.join(dict.fromkeys(names)) or 'no limit'}{did_you_mean(unknown[0], names)}"
            raise ModelError(words, place=self.name, found=Given("hard", unknown[0]))
        soft = np.array([name not in hard for name in names[: len(names) // 2]], dtype=bool)
        return np.tile(np.where(soft, np.cumsum(soft) - 1, -1), 2)

    def _passed(self, slack: np.ndarray, plan: PlannedMotion) -> tuple[str, ...]:
        """Words of the soft limits that the plan passes; others may only touch, by linearisation beyond them a little."""
        if not (most := slack.max(initial=0.0)) > PASSED:
            return ()
        passed = self.stages.beyond(plan.w, plan.u, plan.t) > max(PASSED, 1e-3 * most)
        return tuple(limit.name for limit, so in zip(self.stages.path, passed, strict=True) if so)
