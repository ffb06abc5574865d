"""The fastest motion of the three-link robot along a path, by integration in the phase plane.

Independent of the model and of collocation (Bobrow, Dubowsky and Gibson, 1985; here with friction). With s the way along
the path r(s), cart i at A_i + q_i u_i and the link D_i = r - A_i - q_i u_i of constant length,

    q'  = D . r' / (D . u)                                       from D . (r' - u q') = 0
    q'' = (|r' - u q'|^2 + D . r'') / (D . u)

The plate is carried by forces along its three links, D lambda = m_p (r' s.. + r'' s.^2 - g), and

    f_i = m_i (q_i' s.. + q_i'' s.^2) + friction_i(q_i' s.) + lambda_i D_i . u_i

is linear in s..: every limit |f_i| <= f_max gives an interval of s... The fastest motion speeds up at the upper end of
what they have in common, then slows down at the lower; where nothing is common, the speed is above the limit curve.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import optimize
from scipy.integrate import solve_ivp

root: Any = optimize.brentq
GRAVITY = np.array([0.0, 0.0, -9.81])
TOLERANCE = 1e-11
HIGHEST = 20.0  # m/s, above all speeds


@dataclass(frozen=True)
class Fastest:
    """duration: s; switch: where speeding up ends, in m; least_margin: of the acceleration interval, in m/s2."""

    duration: float
    switch: float
    top_speed: float
    least_margin: float


@dataclass(frozen=True)
class OnPath:
    """The robot on a path. derivatives(s) -> place, first and second derivative, (3, 3); limit: force in N."""

    prototype: Any
    derivatives: Callable[[float], np.ndarray]
    length: float
    limit: float

    def coefficients(self, s: float) -> tuple[np.ndarray, ...]:
        """What the forces depend on at s, (3,) each: f = mass s.. + square s.^2 + weight + friction(q1 s.)."""
        p = self.prototype
        place, first, second = self.derivatives(s)
        anchor = np.array([arm.offset for arm in p.arms])
        axis = np.array([arm.direction for arm in p.arms])
        length = np.array([arm.length for arm in p.arms])
        ahead = np.sum((place - anchor) * axis, axis=1)
        norm = np.sum(axis**2, axis=1)
        away = np.sum((place - anchor) ** 2, axis=1)
        # the tool is ahead of the carts: the smaller of the two solutions of |D| = length
        q = (ahead - np.sqrt(ahead**2 - norm * (away - length**2))) / norm
        link = place - anchor - q[:, None] * axis
        reach = np.sum(link * axis, axis=1)
        q1 = link @ first / reach
        q2 = (np.sum((first - axis * q1[:, None]) ** 2, axis=1) + link @ second) / reach
        pull = (
            p.plate_mass
            * np.linalg.solve(link.T, np.column_stack([first, second, -GRAVITY]))
            * reach[:, None]
        )
        mass = np.array(p.cart_masses)
        return mass * q1 + pull[:, 0], mass * q2 + pull[:, 1], pull[:, 2], q1

    def forces(self, s: float, v: float) -> tuple[np.ndarray, np.ndarray]:
        """Actuator forces as mass * s.. + rest, (3,) in kg and N."""
        mass, square, weight, q1 = self.coefficients(s)
        return mass, square * v**2 + weight + self._friction(q1 * v)

    def _friction(self, speed: np.ndarray) -> np.ndarray:
        return (
            np.array(self.prototype.coulomb) * np.tanh(speed / 0.05)
            + np.array(self.prototype.viscous) * speed
        )

    def interval(self, s: float, v: float) -> tuple[float, float]:
        """The least and the largest acceleration along the path that all limits allow, in m/s2."""
        return self._interval(self.coefficients(s), v)

    def _interval(self, coefficients: tuple[np.ndarray, ...], v: float) -> tuple[float, float]:
        mass, square, weight, q1 = coefficients
        rest = square * v**2 + weight + self._friction(q1 * v)
        one, other = (-self.limit - rest) / mass, (self.limit - rest) / mass
        return float(np.max(np.minimum(one, other))), float(np.min(np.maximum(one, other)))

    def duration_by_reach(self, steps: int) -> float:
        """The same for any number of switches, to first order in 1 / steps: s.. is constant on each part of s.

        Backwards, the largest speeds from which the end is reached with no limit violated; then forwards, as fast as
        the limits and those speeds allow (Pham and Pham, 2018, without their assumption that forces are linear in s.^2).
        """
        u = np.linspace(0.0, 1.0, steps + 1)
        # finer towards both ends, where speeds grow with the root of s
        grid = self.length * u**2 * (3 - 2 * u)
        h = np.diff(grid)
        known = [self.coefficients(s) for s in grid]
        reachable = np.zeros(steps + 1)  # squares of speeds
        for i in range(steps - 1, -1, -1):
            reachable[i] = self._slowed(known[i], float(reachable[i + 1]), h[i])
        square, duration = 0.0, 0.0
        for i in range(steps):
            _, most = self._interval(known[i], np.sqrt(square))
            after = min(square + 2 * h[i] * most, float(reachable[i + 1]))
            duration += 2 * h[i] / (np.sqrt(square) + np.sqrt(after))
            square = after
        return float(duration)

    def _slowed(self, coefficients: tuple[np.ndarray, ...], after: float, h: float) -> float:
        """The largest square of a speed, below the limit curve, from which a step leads to at most `after`."""

        def margin(v: float) -> float:
            low, high = self._interval(coefficients, v)
            return high - low

        def over(v: float) -> float:
            return v**2 + 2 * h * self._interval(coefficients, v)[0] - after

        top = HIGHEST if margin(HIGHEST) > 0.0 else float(root(margin, 0.0, HIGHEST, xtol=1e-13))
        return top**2 if over(top) <= 0.0 else float(root(over, 0.0, top, xtol=1e-13)) ** 2

    def fastest(self) -> Fastest:
        """From rest to rest, for motions that speed up once and slow down once. ValueError for others."""
        forth, back = self._run(0.0, 1), self._run(self.length, -1)

        def apart(s: float) -> float:
            return float(_at(forth, s)[1] - _at(back, s)[1])

        ends = max(back.y[0, -1], 1e-6), min(forth.y[0, -1], self.length - 1e-6)
        if not ends[0] < ends[1] or not apart(ends[0]) < 0.0 < apart(ends[1]):
            raise ValueError(
                "the limit curve is met before the two motions meet: there are more switches than one"
            )
        switch = float(root(apart, *ends, xtol=1e-13))
        times = [_at(run, switch)[0] for run in (forth, back)]
        margins = []
        for s in np.linspace(1e-4, 1 - 1e-4, 400) * self.length:
            low, high = self.interval(s, _at(forth if s < switch else back, s)[1])
            margins.append(high - low)
        return Fastest(times[0] + times[1], switch, float(_at(forth, switch)[1]), min(margins))

    def _run(self, start: float, sign: int) -> Any:
        """From rest with all that the limits give; backwards in time for sign -1, until the other end or the limit."""

        def rate(_: float, y: np.ndarray) -> list[float]:
            return [sign * y[1], sign * self.interval(y[0], y[1])[0 if sign < 0 else 1]]

        def arrived(_: float, y: np.ndarray) -> float:
            return (self.length - y[0] if sign > 0 else y[0]) + 1e-9

        def limited(_: float, y: np.ndarray) -> float:
            low, high = self.interval(y[0], y[1])
            return high - low

        events: list[Any] = [arrived, limited]
        for event in events:
            event.terminal = True
        return solve_ivp(
            rate, (0.0, 20.0), [start, 0.0], "DOP853", dense_output=True, events=events,
            rtol=TOLERANCE, atol=TOLERANCE, max_step=0.02,
        )  # fmt: skip


def _at(run: Any, s: float) -> tuple[float, float]:
    """Time and speed of a motion where it passes s."""
    time = root(lambda t: run.sol(t)[0] - s, 0.0, run.t[-1], xtol=1e-14)
    return float(time), float(run.sol(time)[1])
