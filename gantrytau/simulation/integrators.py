"""The integrators of one run, and a step with them from one point to another."""

import contextlib
import io
import signal
from collections.abc import Iterator
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.kernels import Kernel
from gantrytau.results.run_statistics import BESIDE, INTEGRATION, MAKING, RunStatistics
from gantrytau.simulation.events.at_places import AtPlaces
from gantrytau.simulation.full_coordinates import FUNCTIONS, Coordinates
from gantrytau.simulation.memory.hermite import ORDER, shifted
from gantrytau.simulation.singular_poses import Point

MOST_STEPS = 100_000  # of the integrator between two ends
BRIEF = 1e-5  # of an interval: longer steps are left to the integrator
SHORT = 1e-12  # of a state, or of its size: change of the rates within a step of second order
WORST = 100.0  # times the largest algebraic: rounding errors that are borne near a singular pose
FINEST = 5e-16  # tolerance that CVODES takes
WALKED_STEPS = 5_000  # of the integrator in one step of the walk to where it ends


class Integrators:
    """Integrators over some numbers of intervals, made when they are needed.

    size: of algebraics, below which their errors do not count; by_modes: whether each choice of modes has its own;
    most: steps to one end; work: what they take, counted.
    """

    def __init__(
        self,
        coordinates: Coordinates,
        tolerance: float,
        longest: float | None,
        interval: float,
        work: RunStatistics,
    ):
        """longest: step anywhere, s; interval: the longest between two places, s."""
        self.coordinates, self.tolerance = coordinates, max(tolerance, FINEST)
        self.sizes = np.array(coordinates.sizes or [1.0] * len(coordinates.states))
        self.pressed = self.working = False
        self.longest, self.interval = longest, interval
        self.shorter: float | None = None  # step, while a function of time changes after it was at rest, s
        self.size, self.by_modes = 1.0, False
        self.work = work
        self.most, self.steps = MOST_STEPS, 0  # steps: that `over` took

    def over(
        self, x: np.ndarray, z: np.ndarray, t: np.ndarray, courses: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """States and algebraics, (count, n) and (count, m), at all but the first of the times t (count + 1,).

        x, z: at the first; courses: what a stepwise model is told of each interval, else the times are equidistant.
        """
        count = len(t) - 1
        p = [t[0], t[1] - t[0]] if courses is None else []
        return self._integrate(count, self.most, x, z, p, [] if courses is None else courses)

    def step(self, point: Point, step: float, most: int = WALKED_STEPS) -> Point:
        """The point a step later, in s; RuntimeError or SolveError where there is none."""
        x, z, t, inputs = point
        there = _later(self.coordinates, inputs, step)
        when, w = np.array([t + step]), there[None]
        found = self._short(point, step, when, w)
        if found is None:
            p, u = ([], [t, step, 0, *inputs]) if self.coordinates.stepwise else ([t, step], [])
            while found is None:
                try:
                    found = self._integrate(1, most, x, z, p, u)
                except RuntimeError as error:
                    if not self.rounded(error, z):
                        raise
        near, far = found
        near = self.coordinates.project(near, when, w)
        return near[0], self.coordinates.settle(near, far, when, w)[0], t + step, there

    def _short(
        self, point: Point, step: float, when: np.ndarray, w: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray] | None:
        """States and algebraics behind a step so short that Heun's is exact to rounding; None if it is longer."""
        x, z, t, inputs = point
        if step > BRIEF * self.interval:
            return None
        rates = self.coordinates.rates
        first = rates(x[None], z[None], t, t, inputs[None])[0]
        far = x + step * first
        forces = self.coordinates.settle(far, z[None], when, w)
        bend = step / 2 * (rates(far, forces, when, when, w)[0] - first)
        short = np.all(np.abs(bend) <= SHORT * np.maximum(np.abs(x), self.sizes))
        return (far + bend, forces) if short and np.all(np.isfinite(forces)) else None

    def interrupt(self) -> None:
        """Act upon Ctrl-C: an integrator at work fails at once, as it would go on after a single interruption."""
        self.pressed = True
        if self.working:
            signal.raise_signal(signal.SIGINT)  # again as soon as it asks whether there was one
            raise KeyboardInterrupt

    @contextlib.contextmanager
    def _at_work(self) -> Iterator[None]:
        self.working = True
        try:
            yield
        except RuntimeError:
            if self.pressed:
                raise KeyboardInterrupt from None
            raise
        finally:
            self.working = False

    def rounded(self, error: RuntimeError, z: np.ndarray) -> bool:
        """Whether algebraics may have larger rounding errors than so far, where an integrator gave up for them.

        Where large forces decide a small one, rounding keeps the integrator from making better what `settle` found: it
        gives up, at its start or in a step, and is asked for less; at its start near a singular pose for less again.
        """
        most = float(np.abs(z).max(initial=1.0))
        largest = (
            WORST * most if "IDACalcIC" in str(error) else most if "IDA_CONV_FAIL" in str(error) else 0.0
        )
        if self.size >= largest:
            return False
        self.size = most if self.size < most else 10 * self.size
        return True

    def _count(self, integrator: ca.Function, kernels: dict[str, Kernel]) -> None:
        """Note the steps of an integrator, and how often it called its functions."""
        stats = integrator.stats(1)  # of the memory that `AtPlaces` has
        self.steps, work = int(stats["nsteps"]), self.work
        work.steps += self.steps
        work.rejected += int(stats["netfails"]) + int(stats["nncfails"])
        work.evaluations += int(stats["nfevals"])
        work.jacobians += int(stats["nlinsetups"])
        work.restarts += 1
        for name in FUNCTIONS:
            if name not in kernels:
                kernels[name] = Kernel(integrator.get_function(name))
            kernels[name].called(stats[f"n_call_{name}"])

    def _integrate(
        self, count: int, most: int, x: np.ndarray, z: np.ndarray, p: Any, u: Any
    ) -> tuple[np.ndarray, np.ndarray]:
        """One call of an integrator, which else writes its complaints to the screen."""
        own = len(self.coordinates.switches) if self.by_modes else 0
        modes = tuple(np.reshape(u, (-1, count), order="F")[-own:, 0].tolist()) if own else ()
        limits = [step for step in (self.longest, self.shorter) if step is not None]
        longest = min(limits) / self.interval if limits else None
        size, tolerance = self.size, self.tolerance
        kept, sizes = self.coordinates.kept, self.coordinates.sizes
        kernels = kept(("kernels of integrators", modes, sizes), dict[str, Kernel])
        functions = {name: own.function for name, own in kernels.items()}
        there = tuple(name for name, own in kernels.items() if own.there)
        with self.work.spent_on(MAKING, BESIDE):
            integrator = kept(
                ("integrator", count, most, modes, longest, size, tolerance, sizes, there),
                lambda: AtPlaces(
                    self.coordinates.integrator(
                        count,
                        tolerance,
                        size=size,
                        steps=most,
                        modes=modes,
                        longest=longest,
                        functions=functions,
                    )
                ),
            )
        start = (x / self.sizes)[None] if x.size else np.zeros((1, 1))
        given = start, z[None], np.reshape(p, (1, -1)), np.reshape(u, (1, -1), order="F")
        spent = self.work.spent_on(INTEGRATION, BESIDE)
        with contextlib.redirect_stderr(io.StringIO()), self._at_work(), spent:
            far, forces, *_ = integrator(
                *given, *(0.0 for _ in range(integrator.function.n_in() - len(given)))
            )
        self._count(integrator.function, kernels)
        reached = far.reshape(count, -1) * self.sizes if x.size else np.zeros((count, 0))
        if not np.all(np.isfinite(reached)):
            raise RuntimeError("the solution is not finite")
        return reached, forces.reshape(count, -1)


def _later(coordinates: Coordinates, w: np.ndarray, step: float) -> np.ndarray:
    """Sampled, held and delayed values, (k,), a step later, in s."""
    half, own = len(coordinates.sampled), coordinates.delay_columns
    if not half and own.stop == own.start:
        return w.copy()
    there = np.concatenate([w[:half] + step * w[half : 2 * half], w[half:]])
    past = slice(2 * half + own.start, 2 * half + own.stop)
    there[past] = shifted(w[past].reshape(-1, ORDER + 1), step).ravel()
    return there
