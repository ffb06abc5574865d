"""Gains of a PID controller from a linear plant: by stated margins, or the most integral gain under sensitivity peaks."""

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from gantrytau.answers.linear_systems.bode_and_poles import frequencies_to_draw
from gantrytau.answers.linear_systems.closed_loop import SisoSystem, all_stable, channel
from gantrytau.answers.linear_systems.linear_system import LinearSystem
from gantrytau.answers.linear_systems.margins import Margins, margins_of
from gantrytau.answers.linear_systems.state_space import StateSpace
from gantrytau.border.checks import check_words, instance, number
from gantrytau.border.refusal import Given, ModelError
from gantrytau.describing.record import Record

Kind = Literal["PI", "PD", "PID"]
RATIO = 4.0  # T_i / T_d of a PID, whose zeros are real and equal then (Ziegler and Nichols)
DECADES = 4.0  # of times, to both sides of the crossover
JUMP = 50.0  # a line in the plane of L that is longer leads over a pole on the axis
TIMES, GAINS = 60, 80  # tried before the best is refined


@dataclass(frozen=True, eq=False)
class PidGains(Record):
    """Gains as `Pid(**gains.settings)` has them, for a sampled plant `DiscretePid(**gains.settings)`.

    k: gain, in the unit of the plant's input for one of its output; T_i, T_d: s, inf and 0 for a part that is not there;
    N: T_d over the time constant of the derivative's filter; period: s, None if continuous; loop: plant and controller in
    series, for `.margins()`, `.plot_nyquist()`.
    """

    kind: Kind
    k: float
    T_i: float
    T_d: float
    N: float
    period: float | None
    loop: StateSpace = field(repr=False)
    margins: Margins = field(repr=False)

    @property
    def settings(self) -> dict[str, Any]:
        """Modifications of a `Pid` or `DiscretePid`."""
        found: dict[str, Any] = dict(kind=self.kind, k=self.k)
        if "I" in self.kind:
            found["T_i"] = self.T_i
        if "D" in self.kind:
            found |= dict(T_d=self.T_d, N=self.N)
        return found if self.period is None else found | dict(period=self.period)


def tune_pid(
    plant: LinearSystem,
    kind: Kind = "PI",
    *,
    crossover: float | None = None,
    phase_margin: float | None = None,
    M_s: float | None = None,
    M_t: float | None = None,
    N: float = 10.0,
    output: str | None = None,
    input: str | None = None,
) -> PidGains:
    """Gains of `Pid` (of `DiscretePid` for a plant with a period) around one output and one input of a plant.

    By margins: crossover in Hz, where the loop has the gain 1 and a phase margin in deg, 60 if none is given; `.margins`
    has the smallest of all crossings. By loop shaping, without a crossover: the largest integral gain k / T_i for which |S|
    stays below M_s (1.4 if neither is given) and |T| below M_t (Astrom, Panagopoulos, Hagglund, Design of PI controllers
    based on non-convex optimization, Automatica 34, 1998).
    A PID has T_i = 4 T_d. k is below zero for a plant that answers downwards. output, input: names, where there are
    several. Raises ModelError for wrong arguments, a phase that the kind cannot give, and where no gains make a stable loop.
    """
    place = "tune_pid"
    check_words(tune_pid, dict(kind=kind))
    hertz = None if crossover is None else number(place, "crossover", crossover, unit="Hz", above=0)
    if phase_margin is not None and hertz is None:
        words = "expected a crossover in Hz beside it; without one, M_s and M_t bound the loop"
        raise ModelError(words, place=place, found=Given("phase_margin", phase_margin))
    margin = number(place, "phase_margin", 60.0 if phase_margin is None else phase_margin, above=0, below=180)
    peaks = {
        name: number(place, name, M, above=1) for name, M in (("M_s", M_s), ("M_t", M_t)) if M is not None
    }
    N = number(place, "N", N, above=0)
    instance(place, "plant", plant, LinearSystem)
    design = _Design(channel(plant, place, output, input), kind, N)
    if hertz is not None:
        if peaks:
            words = "expected either a crossover with a phase margin, or bounds on sensitivity peaks"
            raise ModelError(words, place=place, found=Given(*next(iter(peaks.items()))))
        if plant.period is not None:
            number(place, "crossover", hertz, unit="Hz", below=0.5 / plant.period)
        return _by_margins(design, hertz, margin)
    if kind == "PD":
        words = "expected a crossover in Hz: loop shaping looks for the most integral gain, and a PD has none"
        raise ModelError(words, place=place, argument="crossover")
    peaks = peaks or dict(M_s=1.4)
    return _by_shaping(design, peaks.get("M_s", np.inf), peaks.get("M_t", np.inf))


@dataclass(frozen=True, eq=False)
class _Design:
    """A plant and a controller with one time left open: T_i of a PI, T_d of a PD, of a PID both by their ratio."""

    plant: SisoSystem
    kind: Kind
    N: float

    def times(self, time: float) -> tuple[float, float]:
        """T_i and T_d."""
        return {"PI": (time, 0.0), "PD": (np.inf, time), "PID": (RATIO * time, time)}[self.kind]

    def controller(self, k: float, time: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """A, B, C, D of `Pid`, of `DiscretePid` if sampled; states: integral part and filter of the derivative."""
        (T_i, T_d), h = self.times(time), self.plant.period
        rate = (0.0 if T_d == 0 else self.N / T_d) if h is None else h / (T_d / self.N + h)
        lead = (self.N if T_d else 0.0) if h is None else T_d / (T_d / self.N + h)
        A = np.diag([0.0, -rate]) if h is None else np.diag([1.0, 1 - rate])
        B = np.array([[(1.0 if h is None else h) / T_i], [rate]])
        keep = [x for x, letter in enumerate("ID") if letter in self.kind]
        C, D = k * np.array([[1.0, -lead]]), np.array([[k * (1 + lead)]])
        return A[np.ix_(keep, keep)], B[keep], C[:, keep], D

    def shape(self, time: float, hertz: np.ndarray) -> np.ndarray:
        """The response of the controller with a gain of one at frequencies (N,) in Hz."""
        return SisoSystem("", "", "", *self.controller(1.0, time), self.plant.period).response(hertz)

    def loop(self, k: float, time: float) -> SisoSystem:
        """Controller, then plant."""
        P = self.plant
        A, B, C, D = self.controller(k, time)
        whole = np.block([[P.A, P.B @ C], [np.zeros((len(A), len(P.A))), A]])
        in_, out = np.vstack([P.B @ D, B]), np.hstack([P.C, P.D @ C])
        return SisoSystem(P.title, P.input, P.output, whole, in_, out, P.D @ D, P.period)

    def stable(self, k: float, time: float) -> bool:
        """Whether the closed loop is stable."""
        closed = self.loop(k, time).closed()
        return all_stable(np.linalg.eigvals(closed.A), closed.period)

    def gains(self, k: float, time: float) -> PidGains:
        """The record of these gains."""
        loop, h = self.loop(k, time), self.plant.period
        system = StateSpace(loop.A, loop.B, loop.C, loop.D, period=h)
        return PidGains(self.kind, k, *self.times(time), self.N, h, system, margins_of(loop))


def _by_margins(design: _Design, crossover: float, phase_margin: float) -> PidGains:
    """The time by the phase that the controller must add at the crossover, the gain by the size of the plant there."""
    from scipy.optimize import brentq

    at = np.array([crossover])
    P = complex(design.plant.response(at)[0])
    if not np.isfinite(P) or P == 0:
        words = f"found a plant that answers with {abs(P):g} at {crossover:g} Hz, expected another "
        raise ModelError(words, Given("crossover"), place="tune_pid", argument="crossover")
    logs = np.linspace(-DECADES, DECADES, 400) * np.log(10) - np.log(2 * np.pi * crossover)

    def added(log: float) -> float:
        return float(np.angle(design.shape(float(np.exp(log)), at)[0], deg=True))

    phases = np.array([added(log) for log in logs])
    wanted = [(phase_margin - 180 - np.degrees(np.angle(sign * P)) + 180) % 360 - 180 for sign in (1.0, -1.0)]
    for sign, phase in zip((1.0, -1.0), wanted, strict=True):
        for i in np.flatnonzero((phases[:-1] - phase) * (phases[1:] - phase) < 0):
            time = float(np.exp(brentq(lambda log, phase=phase: added(log) - phase, logs[i], logs[i + 1])))
            k = sign / abs(P * complex(design.shape(time, at)[0]))
            if design.stable(k, time):
                return design.gains(k, time)
    words = (
        f"expected a crossover at which the {design.kind} adds {wanted[0]:.1f} deg and the loop is stable; it can add "
        f"{phases.min():.1f} to {phases.max():.1f} deg there. Choose "
        f"a lower crossover, less phase margin{', or a PID' * (design.kind == 'PI')}"
    )
    raise ModelError(words, place="tune_pid", found=Given("crossover", crossover))


def _by_shaping(design: _Design, M_s: float, M_t: float) -> PidGains:
    """The largest k / T_i within the bounds, over a grid of times that is refined around the best."""
    from scipy.optimize import minimize_scalar

    hertz = frequencies_to_draw(design.plant)
    ends = hertz[0], hertz[-1]
    far = np.geomspace(ends[0] / 100, ends[1] * (1000 if design.plant.period is None else 1), 600)
    hertz = np.unique(np.append(hertz, far))
    crossovers = (hertz >= ends[0]) & (hertz <= ends[1])
    P = design.plant.response(hertz)
    times = 1 / (2 * np.pi * np.geomspace(*ends, TIMES))
    for sign in (1.0, -1.0):

        def integral_gain(time: float, sign: float = sign) -> float:
            k = _most_gain(design, time, sign, P * design.shape(time, hertz), crossovers, (M_s, M_t))
            return k / design.times(time)[0]

        found = np.array([integral_gain(float(time)) for time in times])
        if not np.any(found > 0):
            continue
        i = int(np.argmax(found))
        if i == TIMES - 1 or np.isinf(found[i]):
            words = (
                "expected a crossover in Hz: the integral gain rises without end, and no dynamics of the plant limit it; "
                "add those of the actuator, the filter or the sampling, or give a crossover"
            )
            raise ModelError(words, place="tune_pid", argument="crossover")
        ends = np.log(times[[min(i + 1, TIMES - 1), max(i - 1, 0)]])
        best = minimize_scalar(lambda log: -integral_gain(float(np.exp(log))), bounds=ends, method="bounded")
        time = float(np.exp(best.x)) if -float(best.fun) > found[i] else float(times[i])
        return design.gains(sign * integral_gain(time) * design.times(time)[0], time)
    words = f"found no gains of a {design.kind} that hold |S| < {M_s:g} and |T| < {M_t:g} in a stable loop, expected some"
    raise ModelError(
        f"{words}: allow more{', or take a PID' * (design.kind == 'PI')}", place="tune_pid", argument="M_s"
    )


def _most_gain(
    design: _Design,
    time: float,
    sign: float,
    shape: np.ndarray,
    crossovers: np.ndarray,
    most: tuple[float, float],
) -> float:
    """The largest gain within M_s and M_t for a loop that is `shape` (N,) with a gain of one; 0 if there is none, infinite
    if they hold beyond the dynamics of the plant.
    """
    from scipy.optimize import brentq

    known = np.isfinite(shape) & (shape != 0)
    sizes, curve = 1 / np.abs(shape[known & crossovers]), sign * shape[known]
    M_s, M_t = most
    # |S| = M_s and |T| = M_t are circles about these centres in the plane of L
    circles = [(-1.0, 1 / M_s), *([(-(M_t**2) / (M_t**2 - 1), M_t / (M_t**2 - 1))] if M_t < np.inf else [])]

    def excess(k: float) -> float:
        return max(radius / _distance(k * curve, centre) for centre, radius in circles) - 1

    gains = np.geomspace(sizes.min(), sizes.max(), GAINS)
    held = np.array([excess(float(k)) < 0 for k in gains])
    for i in np.flatnonzero(held)[::-1]:
        if not design.stable(sign * float(gains[i]), time):
            continue
        if i + 1 == GAINS:
            return np.inf
        if held[i + 1]:  # beyond, it is another loop
            return float(gains[i])
        return brentq(excess, gains[i], gains[i + 1], xtol=1e-12 * gains[i])
    return 0.0


def _distance(curve: np.ndarray, centre: float) -> float:
    """From a point to the straight lines between the points (N,) of a curve: a peak between two of them counts."""
    start, line = curve[:-1] - centre, np.diff(curve)
    size = np.abs(line) ** 2
    share = np.clip(-np.real(start * np.conj(line)) / np.where(size > 0, size, 1.0), 0.0, 1.0)
    near = np.abs(start + share * line)
    return float(np.min(np.where(size < JUMP**2, near, np.minimum(np.abs(start), np.abs(start + line)))))
