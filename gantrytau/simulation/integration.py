"""One run of the integrator over a grid: in chunks, held to the constraints, watched for singular poses."""

import contextlib
import io
from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.errors import SolveError
from gantrytau.interruption import on_interrupt
from gantrytau.progress import Progress
from gantrytau.simulation.full_coordinates import Coordinates
from gantrytau.simulation.instants_on_mesh import instants
from gantrytau.simulation.signals import PiecewiseLinear, Signal
from gantrytau.simulation.singular_poses import Approach, Look, Point, approach, doubtful

CHUNK = 10  # output intervals between two projections onto the constraints
LEAST_STEPS = 500  # of the mesh on which singular poses are looked for, however few points are asked for
MOST_STEPS = 100_000  # of the integrator between two ends
WALKED_STEPS = 5_000  # of the integrator in one step of the walk to where it ends
REASONS = {
    "TOO_MUCH_WORK": "the steps became too small",
    "ERR_FAIL": "the steps became too small",
    "CONV_FAIL": "the equations of a step found no solution",
    "RHSFUNC": "the equations are not finite",
    "RES_FAIL": "the equations are not finite",
    "LSETUP_FAIL": "the equations of a step are singular",
    "LSOLVE_FAIL": "the equations of a step are singular",
}


class Run:
    """One integration over a grid, in chunks."""

    def __init__(
        self, coordinates: Coordinates, signals: Mapping[str, Signal], grid: np.ndarray, tolerance: float
    ):
        self.coordinates, self.tolerance = coordinates, tolerance
        samples = {n: s for n, s in signals.items() if isinstance(s, PiecewiseLinear)}
        self.samples = [samples[n] for n in coordinates.sampled]
        knots = np.concatenate([s.times for s in self.samples]) if self.samples else np.array([])
        knots = knots[(knots > grid[0]) & (knots < grid[-1])]
        parts = max(1, -(-LEAST_STEPS // (grid.size - 1)))
        fine = np.interp(np.arange((grid.size - 1) * parts + 1) / parts, np.arange(grid.size), grid)
        fine[::parts] = grid
        mesh = np.unique(np.concatenate([fine if coordinates.conditioning.needed else grid, knots]))
        table, events = coordinates.dae.table, coordinates.dae.flat.sampled
        periods = np.array([table.number(s.period) for s in events])
        self.instants = instants(mesh, coordinates.held, periods)
        self.mesh = self.instants.mesh
        self.kept = np.searchsorted(self.mesh, grid)
        self.x = np.full((self.mesh.size, len(coordinates.states)), np.nan)
        self.z = np.full((self.mesh.size, len(coordinates.algebraics)), np.nan)
        self.held = np.full((self.mesh.size, len(coordinates.held)), np.nan)  # from each place on
        self.held[0] = [coordinates.dae.start[n] for n in coordinates.held]
        self.done = 0
        self.seen = -1  # the last interval of the mesh that was looked at closely
        self.integrators: dict[tuple[int, int], ca.Function] = {}
        self.size = 1.0  # of algebraics, below which their errors do not count

    def so_far(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Times, states, algebraics and held variables at the output points that were reached."""
        kept = self.kept[self.kept <= self.done]
        return self.mesh[kept], self.x[kept], self.z[kept], self.held[kept]

    def go(self) -> None:
        self.x[0], self.z[0] = self.coordinates.start(self.mesh[0], self._inputs(0))
        self._renew(0)
        last = self.mesh.size - 1
        pressed: list[bool] = []
        with Progress(self.mesh[0], self.mesh[-1]) as progress, on_interrupt(lambda: pressed.append(True)):
            size = CHUNK if self.coordinates.constrained or self.coordinates.stepwise else last
            size = min(size, max(CHUNK, last // 50))
            while self.done < last:
                count = min(size, int(self.instants.stretch[self.done]))
                try:
                    self._advance(count)
                except RuntimeError as error:
                    if "IDACalcIC" in str(error) and self._rounded():
                        continue
                    if count == 1:
                        raise self._stopped(error) from error
                    size = 1
                    continue
                self._renew(self.done)
                progress.at(self.mesh[self.done])
                if pressed:
                    raise KeyboardInterrupt

    def _inputs(self, k: int) -> np.ndarray:
        """Values and slopes of the sampled inputs, and what is held, on the k-th interval of the mesh."""
        t = self.mesh[k]
        h = self.mesh[min(k + 1, self.mesh.size - 1)] - t
        values = np.array([np.interp(t, s.times, s.values) for s in self.samples])
        after = np.array([np.interp(t + h, s.times, s.values) for s in self.samples])
        slopes = (after - values) / h if h > 0 else 0.0 * values
        return np.concatenate([values, slopes, self.held[k]])

    def _renew(self, k: int) -> None:
        """Give new values to what is sampled at a place of the mesh, all from the values just before."""
        due = self.instants.due[k]
        if not due.any():
            return
        t = float(self.mesh[k])
        new = np.array(self.coordinates.renewed(self.x[k], self.z[k], t, t, self._inputs(k))).ravel()
        bad = [
            n
            for n, value, now in zip(self.coordinates.held, new, due, strict=True)
            if now and not np.isfinite(value)
        ]
        if bad:
            raise SolveError(
                f"{self.coordinates.dae.name}: {bad[0]} is sampled at t = {t:.6g} s, and its new value is not finite; "
                ".result holds the motion up to there: look for a division by zero or a root of a negative number",
                time=t,
                equations=[],
            )
        self.held[k, due] = new[due]
        places = slice(k, k + 1)
        inputs = self._inputs(k)[None]
        self.z[places] = self.coordinates.settle(self.x[places], self.z[places], self.mesh[places], inputs)

    def _courses(self, here: int, count: int) -> np.ndarray:
        """What the integrator is told of each interval: start, length, number, and the inputs."""
        h = np.diff(self.mesh[here : here + count + 1])
        if not self.samples and np.ptp(h) <= 1e-9 * h[0]:  # nothing changes, so that nothing starts anew
            length = (self.mesh[here + count] - self.mesh[here]) / count
            return np.repeat(np.array([[self.mesh[here], length, 0, *self.held[here]]]).T, count, axis=1)
        inputs = np.array([self._inputs(here + k) for k in range(count)]).T
        return np.vstack([self.mesh[here : here + count], h, np.arange(count), inputs])

    def _advance(self, count: int) -> None:
        here = self.done
        stepwise = self.coordinates.stepwise
        self.held[here + 1 : here + count + 1] = self.held[here]
        found = self._integrate(
            count,
            MOST_STEPS,
            x0=self.x[here] if self.coordinates.states else 0.0,
            z0=self.z[here],
            p=[] if stepwise else [self.mesh[here], self.mesh[here + 1] - self.mesh[here]],
            u=self._courses(here, count) if stepwise else [],
        )
        x, z = np.array(found["xf"]).T, np.array(found["zf"]).T.reshape(count, -1)
        x = x if self.coordinates.states else np.zeros((count, 0))
        if not np.all(np.isfinite(x)):
            raise RuntimeError("the solution is not finite")
        reached = slice(here + 1, here + count + 1)
        inputs = np.array([self._inputs(k) for k in range(here + 1, here + count + 1)])
        try:
            self.x[reached] = self.coordinates.project(x, self.mesh[reached], inputs)
        except SolveError as error:  # perhaps only for want of shorter stretches
            raise RuntimeError("the constraints cannot be met any more") from error
        self.z[reached] = self.coordinates.settle(self.x[reached], z, self.mesh[reached], inputs)
        self.done = here + count
        self._watch(here, here + count)
        opened = self.coordinates.opened(self.x[reached], self.mesh[reached], inputs)
        if opened is not None:
            self.done = here + opened[0]
            raise self._opened(opened[1])

    def _watch(self, first: int, last: int) -> None:
        """SolveError if a singular pose lies between two places of the mesh; `done` is then the last before it."""
        if not self.coordinates.conditioning.needed:
            return
        first = max(first - 1, 0)  # the rise behind a pose may show in the next stretch only
        inputs = np.array([self._inputs(k) for k in range(first, last + 1)])
        places = slice(first, last + 1)
        look = self._look(self.x[places], self.z[places], self.mesh[places], inputs)
        for k in first + np.flatnonzero(doubtful(self.mesh[places], look)):
            if k <= self.seen:
                continue
            self.done = self.seen = int(k)
            found = self._approach()
            if found.singular or (not found.arrived and self._weakest(found.point)):
                raise self._singular_pose(found.point, found.zero)
        self.done = last  # passed at a distance, or only the choice of coordinates fails there

    def _opened(self, name: str) -> SolveError:
        t = float(self.mesh[self.done])
        return SolveError(
            f"{self.coordinates.dae.name}: after t = {t:.6g} s the loop opens: {name} was left out because it repeated "
            "other constraints at the start, and it does not any more. Start nearer to that pose, where another "
            "choice is made; .result holds the motion up to there",
            time=t,
            equations=[name],
        )

    def _look(self, x, z, t, inputs) -> Look:
        return self.coordinates.conditioning.look(x.T, z.T, t[None], t[None], inputs.T)

    def _singular_pose(self, point: Point, t: float) -> SolveError:
        """What to say of a singular pose at time t, just behind a point."""
        weakest = self._weakest(point)
        redundant = self.coordinates.dae.redundant
        doubt = (
            f" (constraints were left out as redundant at the start: {redundant[0].name}{', ...' if redundant[1:] else ''}; "
            "if the mechanism is sound at that pose, start nearer to it, so that others are kept)"
            if redundant
            else ""
        )
        return SolveError(
            f"{self.coordinates.dae.name}: the motion meets a singular pose at t = {t:.6g} s, where forces or "
            f"accelerations are not determined. The equations that degenerate there: {'; '.join(weakest)}. .result "
            f"holds the motion up to there: keep away from that pose, or change the geometry{doubt}",
            time=t,
            equations=weakest,
        )

    def _weakest(self, point: Point) -> list[str]:
        return self.coordinates.weakest(point, (self.x[0], self.z[0], float(self.mesh[0]), self._inputs(0)))

    def _stopped(self, error: Exception) -> SolveError:
        found = self._approach()
        point = found.point
        if self._weakest(point):
            return self._singular_pose(point, found.zero)
        reason = next(
            (words for sign, words in REASONS.items() if sign in str(error)), str(error).splitlines()[-1]
        )
        return SolveError(
            f"{self.coordinates.dae.name}: the integration stopped at t = {point[2]:.6g} s: {reason}. The solution "
            "may grow beyond all limits there; .result holds what was computed: look at it, and shorten the time or "
            "change the inputs",
            time=point[2],
            equations=[],
        )

    def _approach(self) -> Approach:
        """Walk from the last point of the mesh to the next, or to a singular pose before it."""
        k = self.done
        point = self.x[k], self.z[k], float(self.mesh[k]), self._inputs(k)
        end = float(self.mesh[min(k + 1, self.mesh.size - 1)])

        def look(at: Point) -> Look:
            x, z, t, w = at
            return self._look(x[None], z[None], np.array([t]), w[None])

        return approach(point, end, self._step, look)

    def _step(self, point: Point, step: float) -> Point:
        """The point a step later, in s."""
        x, z, t, inputs = point
        half = len(self.samples)
        found = self._integrate(
            1,
            WALKED_STEPS,
            x0=x if self.coordinates.states else 0.0,
            z0=z,
            p=[] if self.coordinates.stepwise else [t, step],
            u=[t, step, 0, *inputs] if self.coordinates.stepwise else [],
        )
        there = np.concatenate([inputs[:half] + step * inputs[half : 2 * half], inputs[half:]])
        near = np.array(found["xf"]).ravel()[: x.size]
        if not np.all(np.isfinite(near)):
            raise RuntimeError("the solution is not finite")
        when, w, far = np.array([t + step]), there[None], np.array(found["zf"]).reshape(1, -1)
        near = self.coordinates.project(near[None], when, w)
        return near[0], self.coordinates.settle(near, far, when, w)[0], t + step, there

    def _rounded(self) -> bool:
        """Whether small algebraics may have the rounding errors of large ones, which they did not so far.

        What `settle` found solves the equations as well as rounding allows: where large forces decide a small one, the
        integrator cannot make it better, gives up at once, and is asked for less.
        """
        before, self.size = self.size, float(np.abs(self.z[self.done]).max(initial=1.0))
        self.integrators.clear()
        return self.size > before

    def _integrate(self, count: int, steps: int, **arguments: Any) -> dict[str, ca.DM]:
        """One call of an integrator, which else writes its complaints to the screen."""
        if (count, steps) not in self.integrators:
            integrator = self.coordinates.integrator(count, self.tolerance, size=self.size, steps=steps)
            self.integrators[count, steps] = integrator
        with contextlib.redirect_stderr(io.StringIO()):
            return self.integrators[count, steps](**arguments)
