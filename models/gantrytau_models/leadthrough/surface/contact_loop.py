"""The linear loop behind a tool in contact: sensor, force control, robot and the stiffness of the surface, sampled.

A force gives a velocity, K, the robot follows it, the position presses the surface, stiffness: the gain is g = K stiffness
in 1/s, and only the servo, the period and delays say how large it may be. Section 8.4 of Dressler (2012) prints 68 Hz on a
metal plate and none on cardboard: an almost unstable loop of 4 ms shows that, and noise is enough to make it sound.
"""

import os
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from gantrytau import Model, ModelError, StateSpace
from gantrytau.answers.linear_systems.discretisation import held
from gantrytau.border.checks import number
from gantrytau.compiler.parameters import parameter_table
from gantrytau.flattening.flatten import flatten

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SLOWEST = 1e-9  # of the sampling frequency: a critical gain below it drowns in rounding
HALF = 0.5  # of the sampling frequency, above which nothing is said


class CriticalGain(UserWarning):
    """A force control whose gain is beyond what its loop bears: it hops on the surface."""


@dataclass(frozen=True)
class ContactLoop:
    """The loop of a tool on a surface. gain: K times stiffness, 1/s; T_v: time constant of the servo, s; period: s;
    delay: computing delay, s, shorter or longer than the period; mode, damping: Hz and damping ratio of a structure between
    servo and surface, if there is one.

    Raises ModelError for what is no number, a period or mode that is not above zero, a negative gain, delay, damping or
    time constant, and for a mode so slow that rounding hides where the loop begins to swing.
    """

    gain: float
    T_v: float = 2.303e-3
    period: float = 0.004
    delay: float = 0.0
    mode: float | None = None
    damping: float = 0.02

    def __post_init__(self):
        units = dict(period="s", mode="Hz", gain="1/s", T_v="s", delay="s", damping=None)
        for name, unit in units.items():
            limits = dict(above=0.0) if name in ("period", "mode") else dict(least=0.0)
            if (found := getattr(self, name)) is not None or name != "mode":
                object.__setattr__(self, name, number("ContactLoop", name, found, unit=unit, **limits))

    @cached_property
    def plant(self) -> StateSpace:
        """From the velocity asked for to the position of the tool in m, from sample to sample, its delay included."""
        A, B, C = self._continuous()
        whole, part = divmod(self.delay, self.period)
        # the input changes `part` after the instant: x(k + 1) = Phi x + early u(k - 1) + late u(k)
        Phi, both = held(A, B, self.period)
        __, late = held(A, B, self.period - part)
        early = both - late
        n, lags = len(A), int(whole) + 1
        big, into = np.zeros((n + lags, n + lags)), np.zeros((n + lags, 1))
        big[:n, :n], big[n + 1 :, n : n + lags - 1] = Phi, np.eye(lags - 1)
        into[n] = 1.0
        # the register holds u(k - 1), u(k - 2), ...
        past = [n + j for j in range(lags)]
        if whole:
            big[:n, past[int(whole) - 1]] = late[:, 0]
        else:
            into[:n] = late
        big[:n, past[int(whole)]] += early[:, 0]
        return StateSpace(big, into, np.hstack([C, np.zeros((1, lags))]), [[0.0]], period=self.period)

    def _continuous(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Integrator behind the servo, behind the structure where there is one: x' = A x + B u, r = C x."""
        blocks = []
        if self.T_v > 0:
            blocks.append((np.array([[-1 / self.T_v]]), np.array([[1 / self.T_v]]), np.array([[1.0]])))
        blocks.append((np.zeros((1, 1)), np.ones((1, 1)), np.ones((1, 1))))
        if self.mode is not None:
            w = 2 * np.pi * self.mode
            A = np.array([[0.0, 1.0], [-(w**2), -2 * self.damping * w]])
            blocks.append((A, np.array([[0.0], [w**2]]), np.array([[1.0, 0.0]])))
        A, B, C = blocks[0]
        for a, b, c in blocks[1:]:
            A = np.block([[A, np.zeros((len(A), len(a)))], [b @ C, a]])
            B, C = np.vstack([B, np.zeros((len(a), 1))]), np.hstack([np.zeros((1, len(A) - len(a))), c])
        return A, B, C

    def response(self, frequencies: np.ndarray) -> np.ndarray:
        """The open loop over frequencies (K,) in Hz, complex."""
        return self.gain * self.plant.response(frequencies)[0, 0]

    @cached_property
    def _edge(self) -> tuple[float, float]:
        """Gain and frequency in Hz at which a pole first comes to the unit circle."""
        A, B, C = self.plant.A, self.plant.B, self.plant.C

        def largest(gain: float) -> float:
            return float(np.abs(np.linalg.eigvals(A - gain * B @ C)).max())

        low, high = 0.0, 1.0
        while largest(high) < 1:
            low, high = high, 2 * high
        for _ in range(80):
            middle = (low + high) / 2
            low, high = (middle, high) if largest(middle) < 1 else (low, middle)
        if high * self.period < SLOWEST:
            raise ModelError(
                f"ContactLoop: found mode={self.mode!r} for a period of {self.period:g} s, expected a mode that moves "
                "within some thousand periods; take a longer period, or no mode"
            )
        poles = np.linalg.eigvals(A - high * B @ C)
        angle = abs(np.angle(poles[np.argmax(np.abs(poles))]))
        return high, float(angle / (2 * np.pi * self.period))

    @property
    def critical_gain(self) -> float:
        """The gain K times stiffness at which the loop begins to swing, 1/s."""
        return self._edge[0]

    @property
    def crossover(self) -> float:
        """The frequency in Hz at which it does: where the phase of the loop is half a turn."""
        return self._edge[1]

    @property
    def share(self) -> float:
        """The gain over the critical one: from 1 on the loop is unstable."""
        return self.gain / self.critical_gain

    def __str__(self) -> str:
        critical = f"{100 * self.share:.0f} % of the critical {self.critical_gain:.4g} 1/s"
        return f"gain {self.gain:.4g} 1/s, {critical}, where it swings with {self.crossover:.1f} Hz"

    def plot_nyquist(self, file: str | os.PathLike[str] | None = None) -> "Figure":
        """The open loop in the complex plane with the critical point; file: also save the figure there."""
        from matplotlib.figure import Figure

        hertz = np.geomspace(0.02 * self.crossover, HALF / self.period, 600)
        values, marked = self.response(hertz), self.response(np.array([self.crossover]))[0]
        figure = Figure(figsize=(6, 5), layout="constrained")
        axes = figure.subplots()
        axes.plot(np.real(values), np.imag(values), color="C0", label=f"gain {self.gain:.4g} 1/s")
        axes.plot(np.real(values), -np.imag(values), ":", color="C0", linewidth=1)
        axes.plot(-1, 0, "+", color="C3", markersize=12, label="critical point")
        axes.plot(marked.real, marked.imag, "o", color="C0", label=f"{self.crossover:.1f} Hz")
        angles = np.linspace(0, 2 * np.pi, 200)
        axes.plot(np.cos(angles), np.sin(angles), color="0.8", linewidth=1, zorder=0)
        axes.set(
            xlim=(-2.2, 1.2), ylim=(-1.7, 1.7), xlabel="real part", ylabel="imaginary part", title=str(self)
        )
        axes.title.set_fontsize(9)
        axes.set_aspect("equal")
        axes.grid(alpha=0.3)
        axes.legend(loc="upper right", fontsize=8)
        if file is not None:
            figure.savefig(file)
        return figure


def contact_loop(model: Model) -> ContactLoop:
    """The loop of a `SurfaceTracking`, along the normal of its surface, with the numbers that it has."""
    flat = flatten(model)
    values = parameter_table(flat).values
    try:
        gain = values["control.tool.K[2]"] * values["face.stiffness"]
        return ContactLoop(float(gain), float(values["arm.T_v"]), float(values["control.period"]))
    except KeyError as error:
        raise ModelError(
            f"contact_loop: found {flat.name} without {error.args[0]}, expected a SurfaceTracking"
        ) from None
