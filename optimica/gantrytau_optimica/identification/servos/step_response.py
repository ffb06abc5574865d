"""Measured steps of actuators: references and positions over time."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import array
from gantrytau.describing.record import Record
from gantrytau_optimica.fitting.finding import rows_in_words
from gantrytau_optimica.identification.spectra.sampled_motion import rows_of

EVEN = 0.01  # of the period, by which times of samples may be off
LEAST = 8  # samples from the first change of a reference on, which two parameters and a delay need


@dataclass(frozen=True, eq=False, repr=False)
class StepResponse(Record):
    """References and positions of n actuators, sampled in N rows: a step, or any other motion from rest.

    t: time (N,) in s, evenly spaced; reference, position: (N, n) in m, or rad of turning actuators; (N,) of one actuator.
    Actuators may step at once, or one of them alone. Arrays are copied and cannot be written to. Raises ModelError for
    shapes that do not fit, what is no number, and times that are not evenly spaced.
    """

    t: Any
    reference: Any
    position: Any

    def __post_init__(self):
        for name in ("t", "reference", "position"):
            object.__setattr__(self, name, rows_of("StepResponse", name, getattr(self, name)))
        rows, actuators = len(self.t), self.position.shape[1]
        for name, shape in (
            ("t", (rows,)),
            ("reference", (rows, actuators)),
            ("position", (rows, actuators)),
        ):
            array("StepResponse", name, getattr(self, name), shape)
        _check_times(self.t)

    @property
    def period(self) -> float:
        """Distance of samples in s."""
        return float((self.t[-1] - self.t[0]) / (len(self.t) - 1))

    @property
    def start(self) -> np.ndarray:
        """The row of each actuator, (n,), in which its reference first is another than in row 0; N where it never is."""
        changed = self.reference != self.reference[0]
        return np.where(changed.any(axis=0), np.argmax(changed, axis=0), len(self.t))

    @property
    def size(self) -> np.ndarray:
        """Span of each reference, (n,) in m or rad."""
        return np.ptp(self.reference, axis=0)

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        sizes = ", ".join(f"{size:g}" for size in self.size)
        return f"<StepResponse: {len(self)} rows every {self.period:g} s, steps of {sizes}>"


def check_steps(steps: StepResponse | Sequence[StepResponse]) -> tuple[StepResponse, ...]:
    """One or several as a tuple; ModelError for what are none, or not of the same actuators at the same period."""
    found = (steps,) if isinstance(steps, StepResponse) else steps
    listed = isinstance(found, Sequence) and all(isinstance(step, StepResponse) for step in found)
    if not listed or not len(found):
        raise ModelError(
            f"identify_servo: found steps={steps!r}, expected a StepResponse(t, reference, position) or a list of them",
            argument="steps",
        )
    first = found[0]
    for k, step in enumerate(found):
        if step.position.shape[1] != first.position.shape[1]:
            raise ModelError(
                f"identify_servo: found step {k} of {step.position.shape[1]} actuators beside step 0 of "
                f"{first.position.shape[1]}, expected the same actuators in all",
                argument="steps",
            )
        if abs(step.period - first.period) > EVEN * first.period:
            raise ModelError(
                f"identify_servo: found step {k} every {step.period:g} s beside step 0 every {first.period:g} s, expected "
                "one period in all, as pole and delay are counted in samples",
                argument="steps",
            )
    for i in range(first.position.shape[1]):
        _check_actuator(i, found)
    return tuple(found)


def _check_actuator(i: int, steps: Sequence[StepResponse]) -> None:
    """ModelError where an actuator is not told to move, does not, or is not followed for long enough."""
    told = [k for k, step in enumerate(steps) if step.start[i] < len(step)]
    if not told:
        raise ModelError(
            f"identify_servo: found no step of actuator {i}: its reference never changes; expected one that begins after "
            "the first row, with rows at rest before it",
            argument="steps",
        )
    for k in told:
        left = len(steps[k]) - int(steps[k].start[i])
        if left < LEAST:
            raise ModelError(
                f"identify_servo: found {left} rows of step {k} from where the reference of actuator {i} changes, expected "
                f"{LEAST} at least, and until it stands again; log for longer",
                argument="steps",
            )
    still = [k for k in told if np.ptp(steps[k].position[steps[k].start[i] :, i]) == 0]
    if still:
        raise ModelError(
            f"identify_servo: found that actuator {i} does not move in {'steps' if len(still) > 1 else 'step'} "
            f"{', '.join(map(str, still))}, although its reference does; expected a response: friction may hold it, or its "
            "delay be longer than the log; step farther, log for longer, or leave the step out",
            argument="steps",
        )


def _check_times(t: np.ndarray) -> None:
    if len(t) < 2:
        raise ModelError(f"found {len(t)} rows, expected those of a step", place="StepResponse", argument="t")
    steps = np.diff(t)
    period = float(np.median(steps))
    off = np.flatnonzero(~(np.abs(steps - period) <= EVEN * period)) + 1
    if period <= 0 or off.size:
        raise ModelError(
            f"StepResponse: found times that are not evenly spaced by {period:.6g} s in {rows_in_words(off)}, expected one "
            "period throughout, as the delay is counted in samples; put the samples on a grid by their time stamps first",
            argument="t",
        )
