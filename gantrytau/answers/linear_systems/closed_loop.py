"""One input and one output of a linear system, and the loop that unity feedback closes around them."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from gantrytau.answers.linear_systems.bode_and_poles import frequencies_to_draw
from gantrytau.answers.linear_systems.poles_and_zeros import poles_of, seen_part, transmission_zeros
from gantrytau.answers.linear_systems.responses import frequency_response
from gantrytau.border.checks import one_of
from gantrytau.border.refusal import ModelError

STABLE = 1e-9  # of the largest pole (of 1 in z): poles that are nearer to the edge of stability are on it
BEYOND = 1e6  # how far frequencies reach beyond the slowest and the fastest pole or zero
POINTS = 600


@dataclass(frozen=True, eq=False)
class SisoSystem:
    """y over u of a system in the states that u reaches and y sees: A (n, n), B (n, 1), C (1, n), D (1, 1)."""

    title: str
    input: str
    output: str
    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    period: float | None

    @property
    def poles(self) -> np.ndarray:
        """Eigenvalues of A."""
        return poles_of(self.A, self.period)

    @property
    def zeros(self) -> np.ndarray:
        """Transmission zeros."""
        return transmission_zeros(self.A, self.B, self.C, self.D)

    @property
    def stable(self) -> bool:
        """Whether all poles are left of the imaginary axis, or inside the unit circle."""
        return all_stable(self.poles, self.period)

    @property
    def at_rest(self) -> float:
        """The output for a constant input of one, where the system comes to rest."""
        shift = 0.0 if self.period is None else 1.0
        return float((self.D + self.C @ np.linalg.solve(shift * np.eye(len(self.A)) - self.A, self.B)).item())

    def response(self, hertz: np.ndarray) -> np.ndarray:
        """The response at frequencies (N,) in Hz, (N,) complex, infinite at a pole."""
        s = 2j * np.pi * np.asarray(hertz)
        points = s if self.period is None else np.exp(s * self.period)
        return frequency_response(self.A, self.B, self.C, self.D, points)[0, 0]

    def closed(self, gain: float = 1.0) -> "SisoSystem":
        """The loop closed, w to y with u = gain (w - y); ModelError where 1 + gain D is zero."""
        direct = 1 + gain * float(self.D.item())
        if abs(direct) < 1e-12:
            words = (
                f"found a direct gain of {-gain * direct + 1:g} in the loop, expected 1 + D not to be zero"
            )
            raise ModelError(f"{words}: the loop determines nothing", place=self.title)
        B = self.B * (gain / direct)
        A, C, D = self.A - B @ self.C, self.C / direct, self.D * (gain / direct)
        return SisoSystem(self.title, self.input, self.output, A, B, C, D, self.period)


def channel(system: Any, verb: str, output: str | None, input: str | None) -> SisoSystem:
    """One output over one input by their names, None where there is one alone; ModelError for other names."""
    place = f"{system.title}.{verb}"
    j = _position(place, "input", input, system.inputs)
    i = _position(place, "output", output, system.outputs)
    B, C, D = system.B[:, [j]], system.C[[i]], system.D[[i]][:, [j]]
    A, B, C = seen_part(system.A, B, C)
    if not len(A) and not D.item():
        words = f"found no way from {system.inputs[j]} to {system.outputs[i]}, expected an output that the input moves"
        raise ModelError(words, place=place, argument="output")
    return SisoSystem(system.title, system.inputs[j], system.outputs[i], A, B, C, D, system.period)


def _position(place: str, argument: str, found: str | None, names: tuple[str, ...]) -> int:
    if found is None and len(names) == 1:
        return 0
    return names.index(one_of(place, argument, found, names))


def all_stable(poles: np.ndarray, period: float | None) -> bool:
    """Whether all poles (n,) are on the stable side of the edge of stability, by more than rounding."""
    if period is not None:
        return bool(np.all(np.abs(poles) < 1 - STABLE))
    return bool(np.all(np.real(poles) < -STABLE * np.abs(poles).max(initial=0.0)))


def loop_frequencies(loop: SisoSystem, closed: SisoSystem) -> np.ndarray:
    """Frequencies in Hz, (N,), dense at resonances of the loop, open and closed, and far beyond all poles and zeros."""
    near = np.concatenate([frequencies_to_draw(loop), frequencies_to_draw(closed)])
    low, high = near.min() / BEYOND, near.max() * (BEYOND if loop.period is None else 1.0)
    return np.unique(np.concatenate([near, np.geomspace(low, high, POINTS)]))
