"""The face of linear systems: what one answers, in a line each."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from gantrytau.answers.linear_systems import bode_and_poles
from gantrytau.answers.linear_systems.closed_loop import channel
from gantrytau.answers.linear_systems.discretisation import held, unheld
from gantrytau.answers.linear_systems.loop_pictures import draw_nichols, draw_nyquist, draw_root_locus
from gantrytau.answers.linear_systems.margins import Margins, margins_of
from gantrytau.answers.linear_systems.poles_and_zeros import (
    damping_of,
    in_s,
    poles_of,
    transmission_zeros,
)
from gantrytau.answers.linear_systems.responses import checked_inputs, driven, frequency_response, stepped
from gantrytau.answers.linear_systems.step_information import StepInformation, response_information
from gantrytau.answers.linear_systems.system_files import record, save_system
from gantrytau.border.checks import array, check_words, number
from gantrytau.border.refusal import Given, ModelError
from gantrytau.describing.record import Record

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LOST = 1e-6  # of the largest element, by which a system may differ when it is sampled again
ROUNDING = 1e-12  # relative: eigenvalues that are off the real axis by less are real


class LinearSystem(Record):
    """x' = A x + B u, y = C x + D u; with a period x[k + 1] = A x[k] + B u[k], y[k] = C x[k] + D u[k].

    A (n, n), B (n, m), C (k, n), D (k, m); period: s, None for a continuous system. states, inputs, outputs: names of the
    rows and columns; units: of these, by name.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    period: float | None
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    units: Mapping[str, str]

    def __repr__(self) -> str:
        sizes = f"{len(self.states)} states, {len(self.inputs)} inputs, {len(self.outputs)} outputs"
        kind = "" if self.period is None else f", a sample each {self.period:g} s"
        return f"<{type(self).__name__} {self.title}: {sizes}{kind}>"

    @property
    def title(self) -> str:
        """Title of the system in figures and messages."""
        return "linear system"

    @property
    def poles(self) -> np.ndarray:
        """Eigenvalues of A, (n,) complex, the smallest first: in 1/s, or of a discrete system in z.

        Those of free bodies are exactly 0, or 1 in z.
        """
        return poles_of(self.A, self.period)

    @property
    def zeros(self) -> np.ndarray:
        """Transmission zeros, complex, sorted like poles: values of s (or z) at which an input direction has no output."""
        return transmission_zeros(self.A, self.B, self.C, self.D)

    @property
    def damping(self) -> np.ndarray:
        """Damping ratio of each pole, (n,): -Re(s) / |s|, below zero where it is unstable; 1 for a pole at s = 0."""
        return damping_of(self.poles, self.period)

    @property
    def eigenfrequencies(self) -> np.ndarray:
        """|s| / 2 pi of each pole, (n,), in Hz."""
        return np.abs(in_s(self.poles, self.period)) / (2 * np.pi)

    def response(self, frequencies: Any) -> np.ndarray:
        """The frequency response at frequencies (N,) in Hz, (outputs, inputs, N) complex.

        C (s I - A)^-1 B + D with s = 2 pi i f, or z = exp(2 pi i f period); infinite at a pole. ModelError for invalid
        frequencies, and for those above half the sampling frequency of a discrete system, where the response repeats.
        """
        hertz = self._hertz(frequencies)
        s = 2j * np.pi * hertz
        points = s if self.period is None else np.exp(s * self.period)
        return frequency_response(self.A, self.B, self.C, self.D, points)

    def _hertz(self, frequencies: Any) -> np.ndarray:
        """Frequencies as (N,) in Hz; ModelError for invalid ones."""
        hertz = np.atleast_1d(array(self.title, "frequencies", frequencies, (), (None,)))
        half = np.inf if self.period is None else 0.5 / self.period
        if np.any(hertz < 0) or np.any(hertz > half * (1 + 1e-12)):
            words = f"expected 0 to {half:g} Hz{'' if self.period is None else ', half of the sampling frequency'}"
            raise ModelError(words, place=self.title, found=Given("frequencies", frequencies))
        return hertz

    def discrete(self, period: float) -> "LinearSystem":
        """The exact discrete system for inputs held between samples (zero-order hold).

        period: s. ModelError for a discrete system, or a period not above zero.
        """
        if self.period is not None:
            words = f"found a discrete system with a period of {self.period:g} s, expected a continuous one; take it as it "
            raise ModelError(words, "is, or linearize with another ", Given("period"), place=self.title)
        period = number(self.title, "period", period, unit="s", above=0)
        return _Plain(self, *held(self.A, self.B, period), period)

    def continuous(self) -> "LinearSystem":
        """The continuous system with these samples under held inputs: the inverse of `discrete`.

        Modes are assumed below half the sampling frequency. ModelError for a continuous system, and for a pole at zero or
        on the negative real axis, which no continuous system of this order has.
        """
        if self.period is None:
            raise ModelError(f"{self.title}: found a continuous system, expected one with a period")
        poles = self.poles
        real = np.abs(np.imag(poles)) <= ROUNDING * np.abs(poles)
        strange = poles[real & (np.real(poles) <= ROUNDING)]
        if strange.size:
            raise ModelError(
                f"{self.title}: found a pole at z = {strange[0].real:.4g}, expected none at zero or on the negative real "
                "axis: no continuous system of this order is sampled so (a delay, or noise at half of the sampling rate); "
                "identify a model of another order, or with samples taken more often"
            )
        A, B = unheld(self.A, self.B, self.period)
        again = held(A, B, self.period)[0] if np.all(np.isfinite(A)) else A
        if not np.all(np.abs(again - self.A) <= LOST * np.abs(self.A).max(initial=0.0)):
            raise ModelError(
                f"{self.title}: found poles whose logarithm is lost to rounding (|z| from {np.abs(poles).min():.2g} to "
                f"{np.abs(poles).max():.2g}), expected poles and states "
                "of similar size; scale states, or reduce the order of the system"
            )
        return _Plain(self, A, B, None)

    def simulate(self, u: Any, *, x: Any = None) -> np.ndarray:
        """Outputs (N, outputs) to samples of the inputs.

        u: of a discrete system (N, inputs), one row every period; of a continuous one (times (N,), values (N, inputs)),
        joined by straight lines; outputs are exact at these times. (N,) will do for one input.
        x: the state at the first sample, (n,), else zero. Of a linearization all values are differences from its point.
        """
        name = f"{self.title}.simulate"
        start = np.zeros(len(self.A)) if x is None else array(name, "x", x, (len(self.A),))
        if self.period is not None:
            if isinstance(u, tuple):
                raise ModelError(
                    f"{name}: found (times, values), expected values (N, {len(self.inputs)}) alone, one row every "
                    f"{self.period:g} s"
                )
            return stepped(self.A, self.B, self.C, self.D, checked_inputs(name, u, len(self.inputs)), start)
        if not (isinstance(u, tuple) and len(u) == 2):
            words = f"found {type(u).__name__}, expected (times, values): the system is continuous"
            raise ModelError(words, place=name)
        values = checked_inputs(name, u[1], len(self.inputs))
        times = array(name, "times", u[0], (len(values),))
        if not np.all(np.diff(times) > 0):
            raise ModelError(f"{name}: found times that do not rise, expected one later than the other")
        return driven(self.A, self.B, self.C, self.D, times, values, start)

    def margins(self, *, output: str | None = None, input: str | None = None) -> Margins:
        """Gain, phase, delay and disk margins, sensitivity peaks and bandwidth of the loop that u = w - y closes.

        output, input: names, where there are several. Modes that this pair does not touch do not count.
        """
        return margins_of(channel(self, "margins", output, input))

    def step_information(self, *, output: str | None = None, input: str | None = None) -> StepInformation:
        """Final value, rise, overshoot and settling of the response to a step of one, as the system stands.

        output, input: names, where there are several. ModelError where the response comes to no final value.
        """
        return response_information(channel(self, "step_information", output, input), impulse=False)

    def impulse_information(self, *, output: str | None = None, input: str | None = None) -> StepInformation:
        """Peak and settling of the response to an impulse of area one, of a sampled system to one sample of one.

        output, input: names, where there are several. ModelError where the response does not come to rest.
        """
        return response_information(channel(self, "impulse_information", output, input), impulse=True)

    def plot_bode(
        self,
        frequencies: Any = None,
        *,
        beside: "Mapping[str, LinearSystem | bode_and_poles.Spectrum] | None" = None,
        dB: bool = False,
        rad_per_s: bool = False,
        file: str | os.PathLike[str] | None = None,
    ) -> "Figure":
        """Gain and phase over frequency, each output over each input; saved to `file` if one is named.

        frequencies: (N,) in Hz, else around all poles and zeros. dB, rad_per_s: whether the axes show gains in dB, and
        angular frequencies. beside: name -> another system with as many outputs and
        inputs, or a measured spectrum with `hertz` (N,) and a complex `response` (outputs, inputs, N).
        ModelError for systems and spectra of another shape.
        """
        systems = bode_and_poles.beside_each_other(self, "plot_bode", beside, spectra=True)
        if frequencies is not None and not np.any(self._hertz(frequencies) > 0):
            words = "expected some above 0 Hz, which has no place on the axis"
            raise ModelError(words, place=f"{self.title}.plot_bode", found=Given("frequencies", frequencies))
        return bode_and_poles.draw_bode(
            self, bode_and_poles.curves_of(systems, frequencies), file, dB, rad_per_s
        )

    def plot_poles(
        self,
        *,
        beside: "Mapping[str, LinearSystem] | None" = None,
        file: str | os.PathLike[str] | None = None,
    ) -> "Figure":
        """Poles (crosses) and zeros (circles) in the complex plane; saved to `file` if one is named.

        beside: other systems by their names; where periods differ, poles are drawn in the plane of s = log(z) / period.
        """
        systems = bode_and_poles.beside_each_other(self, "plot_poles", beside)
        return bode_and_poles.draw_poles(systems, file)

    def plot_nyquist(
        self,
        frequencies: Any = None,
        *,
        chart: Literal["nyquist", "nichols"] = "nyquist",
        output: str | None = None,
        input: str | None = None,
        beside: "Mapping[str, LinearSystem] | None" = None,
        file: str | os.PathLike[str] | None = None,
    ) -> "Figure":
        """The loop that u = w - y closes, in the plane of L with -1; "nichols": in dB over degrees with contours of |T|.

        frequencies: (N,) in Hz, else around all poles and zeros. output, input: names, where there are several.
        beside: other systems by their names, with this output and input; file: where it is saved.
        """
        check_words(LinearSystem.plot_nyquist, dict(chart=chart), f"{self.title}.plot_nyquist")
        systems = bode_and_poles.beside_each_other(self, "plot_nyquist", beside)
        loops = {label: channel(one, "plot_nyquist", output, input) for label, one in systems.items()}
        draw = draw_nichols if chart == "nichols" else draw_nyquist
        return draw(loops, None if frequencies is None else self._hertz(frequencies), file)

    def plot_root_locus(
        self,
        gains: Any = None,
        *,
        output: str | None = None,
        input: str | None = None,
        file: str | os.PathLike[str] | None = None,
    ) -> "Figure":
        """Poles of the loop closed by u = k (w - y) for rising gains k, from the poles to the zeros of the system.

        gains: (N,), else those between which poles move. output, input: names, where there are several. file: where it is
        saved. Modes that this pair does not touch are not drawn.
        """
        loop = channel(self, "plot_root_locus", output, input)
        values = None if gains is None else array(f"{self.title}.plot_root_locus", "gains", gains, (None,))
        return draw_root_locus(loop, values, file)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write names and matrices: .json (with poles), .npz (arrays A, B, C, D by name) or .csv (one table); the path.

        ModelError for another suffix, or a folder that is not there.
        """
        return save_system(self, path)

    def record(self) -> dict[str, Any]:
        """Names, units, matrices as lists of rows, and poles with Hz and damping, as what a .json holds."""
        return record(self)

    def unit(self, name: str) -> str:
        """The unit of a state, input or output; "" where none was declared."""
        return self.units.get(name, "")


class _Plain(LinearSystem):
    """Another system of the same inputs and outputs."""

    def __init__(self, of: LinearSystem, A: np.ndarray, B: np.ndarray, period: float | None):
        self.A, self.B, self.C, self.D, self.period = A, B, of.C, of.D, period
        self.states, self.inputs, self.outputs = of.states, of.inputs, of.outputs
        self.units, self._of = of.units, of.title

    @property
    def title(self) -> str:
        """Origin of the system, and its period."""
        return f"{self._of}, {'continuous' if self.period is None else f'every {self.period:g} s'}"
