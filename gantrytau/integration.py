"""One run of the integrator over a grid: in chunks, held to the constraints, watched for singular poses."""

import contextlib
import io
from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.conditioning import CLOSE, Look
from gantrytau.coordinates import Coordinates, Point
from gantrytau.errors import SolveError
from gantrytau.interruption import on_interrupt
from gantrytau.progress import Progress
from gantrytau.sampling import instants
from gantrytau.signals import Samples, Signal

CHUNK = 10  # output intervals between two projections onto the constraints
STRAIGHT = 1.3  # sum of the distances on both sides of a singular pose, relative to a step of the distance
LEAST_STEPS = 500  # of the mesh on which singular poses are looked for, however few points are asked for
HALVINGS = 14  # of the last step, to come near to where the integration stops
WITHIN = 0.5  # relative distance of a singular pose above which none lies within one output interval
FALLEN = 0.05  # relative distance of a singular pose from which its fall is extrapolated
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
        samples = {n: s for n, s in signals.items() if isinstance(s, Samples)}
        self.samples = [samples[n] for n in coordinates.sampled]
        knots = np.concatenate([s.times for s in self.samples]) if self.samples else np.array([])
        knots = knots[(knots > grid[0]) & (knots < grid[-1])]
        parts = max(1, -(-LEAST_STEPS // (grid.size - 1)))
        fine = np.interp(np.arange((grid.size - 1) * parts + 1) / parts, np.arange(grid.size), grid)
        fine[::parts] = grid
        mesh = np.unique(np.concatenate([fine if coordinates.conditioning.needed else grid, knots]))
        table, events = coordinates.dae.table, coordinates.dae.flat.sampled
        periods = np.array([table.number(s.period)[0] for s in events])
        self.instants = instants(mesh, coordinates.held, periods)
        self.mesh = self.instants.mesh
        self.kept = np.searchsorted(self.mesh, grid)
        self.x = np.full((self.mesh.size, len(coordinates.states)), np.nan)
        self.z = np.full((self.mesh.size, len(coordinates.algebraics)), np.nan)
        self.held = np.full((self.mesh.size, len(coordinates.held)), np.nan)  # from each place on
        self.held[0] = [coordinates.dae.start[n] for n in coordinates.held]
        self.done = 0
        self.before = np.zeros(0)  # distance from a singular pose at the output point before the last
        self.integrators: dict[int, ca.Function] = {}

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
                    if count == 1 or isinstance(error, SolveError):
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
        if count not in self.integrators:
            self.integrators[count] = self.coordinates.integrator(count, self.tolerance)
        stepwise = self.coordinates.stepwise
        self.held[here + 1 : here + count + 1] = self.held[here]
        found = self._integrate(
            count,
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
        self.x[reached] = self.coordinates.project(x, self.mesh[reached], inputs)
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
        inputs = np.array([self._inputs(k) for k in range(first, last + 1)])
        places = slice(first, last + 1)
        look = self._look(self.x[places], self.z[places], self.mesh[places], inputs)
        distances = np.concatenate([self.before, look.distance])
        self.before = look.distance[-2:-1]
        shift = distances.size - look.distance.size
        for k in range(last - first):
            here, there = look.distance[k], look.distance[k + 1]
            within = min(here, there) < WITHIN
            crossed = within and look.side[k] * look.side[k + 1] < 0
            # a distance that falls straight to zero within the interval may have risen again behind it
            falling = distances[k + shift - 1] - here if k + shift else 0.0
            if crossed or look.near[k + 1] or (here < WITHIN and here - falling < CLOSE):
                self.done = first + k
                point, distance, zero = self._approach(crossed)
                rising = look.distance[k + 2] - there if k + 2 < look.distance.size else 0.0
                if crossed and (min(here, there) < FALLEN or here + there < STRAIGHT * max(falling, rising)):
                    # the distance falls straight to zero between the two and rises again
                    t, h = self.mesh[first + k], self.mesh[first + k + 1] - self.mesh[first + k]
                    raise self._singular_pose(point, float(t + h * here / (here + there)))
                if look.near[k + 1] or distance < 5 * CLOSE:
                    raise self._singular_pose(point, zero)
                self.done = last  # it is passed at a distance, or only the choice of coordinates fails there

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
        point, _, zero = self._approach()
        if self._weakest(point):
            return self._singular_pose(point, zero)
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

    def _approach(self, crossed: bool = False) -> tuple[Point, float, float]:
        """The last point that can be reached behind the last output point, by halved steps.

        Its distance from a singular pose, and the time at which that distance would be zero. crossed: only
        points on this side of where the determinant of the dependent coordinates changes its sign.
        """
        t, x, z = float(self.mesh[self.done]), self.x[self.done], self.z[self.done]
        inputs = self._inputs(self.done)
        step = longest = float(self.mesh[min(self.done + 1, self.mesh.size - 1)]) - t
        if 1 not in self.integrators:
            self.integrators[1] = self.coordinates.integrator(1, self.tolerance)
        look = self._look(x[None], z[None], np.array([t]), inputs[None])
        seen = [(t, float(look.distance[0]))]
        for _ in range(HALVINGS):
            step /= 2
            try:
                near, far, there = self._step(x, z, t, step, inputs)
            except (RuntimeError, SolveError):
                continue
            new = self._look(near[None], far[None], np.array([t + step]), there[None])
            if new.near[0] or (crossed and new.side[0] != look.side[0]):
                continue
            t, x, z, inputs, look = t + step, near, far, there, new
            seen.append((t, float(look.distance[0])))
        return (x, z, t, inputs), seen[-1][1], _zero(seen, longest)

    def _step(self, x: np.ndarray, z: np.ndarray, t: float, step: float, inputs: np.ndarray):
        """States, algebraics and sampled inputs a step later."""
        half = len(self.samples)
        found = self._integrate(
            1,
            x0=x if self.coordinates.states else 0.0,
            z0=z,
            p=[] if self.coordinates.stepwise else [t, step],
            u=[t, step, 0, *inputs] if self.coordinates.stepwise else [],
        )
        there = np.concatenate([inputs[:half] + step * inputs[half : 2 * half], inputs[half:]])
        near = np.array(found["xf"]).ravel()[: x.size]
        if not np.all(np.isfinite(near)):
            raise RuntimeError("the solution is not finite")
        projected = self.coordinates.project(near[None], np.array([t + step]), there[None])[0]
        return projected, np.array(found["zf"]).ravel(), there

    def _integrate(self, count: int, **arguments: Any) -> dict[str, ca.DM]:
        """One call of an integrator, which else writes its complaints to the screen."""
        with contextlib.redirect_stderr(io.StringIO()):
            return self.integrators[count](**arguments)


def _zero(seen: list[tuple[float, float]], longest: float) -> float:
    """When a distance that falls to zero along a straight line is zero; the last time if it is not soon."""
    t, distance = seen[-1]
    if len(seen) > 1:
        before, larger = seen[-2]
        wait = distance * (t - before) / max(larger - distance, 1e-300)
        if 0 <= wait < longest:
            return t + wait
    return t
