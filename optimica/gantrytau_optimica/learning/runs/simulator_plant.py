"""Another simulator as the plant of learning: an FMU, a co-simulation, or any function of sampled references."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from gantrytau import ModelError, Result, Samples
from gantrytau.border.checks import number
from gantrytau.border.refusal import did_you_mean
from gantrytau.describing.record import Record
from gantrytau_optimica.learning.pose_maps import PoseMap
from gantrytau_optimica.learning.run_variation import STILL, Scatter
from gantrytau_optimica.learning.sensor_noise import with_readings

Simulator = Callable[[Mapping[str, Samples], float], Result]
Names = str | Sequence[str]  # of a vector, of a scalar where there is one, or of all elements
LATE = 1e-6  # of a period, by which a time may be off


class SimulatorPlant(Record):
    """A robot under its servos that a function simulates, `simulator(inputs, stop)`, from rest at the first references.

        SimulatorPlant(lambda inputs, stop: cosimulate({"rig": "rig.fmu"}, stop=stop, step=0.004, inputs=inputs), ...)

    kinematics: those of its controller; period: s, of references; position, velocity: names of the inputs for references of
    the joints, no speeds if None; q: of the true positions of the joints in the result, r: of the tool, a: of its
    acceleration, each of a vector or of its elements, and of a scalar for a single joint; noise: of the readings, none if
    None; the simulator draws all else.
    Raises ModelError for a period that is not above zero.
    """

    def __init__(
        self,
        simulator: Simulator,
        kinematics: PoseMap,
        *,
        period: float,
        position: Names,
        velocity: Names | None = None,
        q: Names,
        r: Names | None = None,
        a: Names | None = None,
        noise: Scatter | None = None,
    ):
        self.period = number("SimulatorPlant", "period", period, above=0.0)
        self.kinematics = kinematics
        self.noise = STILL if noise is None else noise
        self._simulator = simulator
        n = len(kinematics.joints)
        self._inputs = tuple(
            tuple(_elements(word, names, n))
            for word, names in (("position", position), ("velocity", velocity))
            if names is not None
        )
        read = {"q": (q, n), "r": (r, 3), "a": (a, 3)}
        self._read = {
            letter: list(_elements(letter, names, count))
            for letter, (names, count) in read.items()
            if names is not None
        }

    def __repr__(self) -> str:
        return f"<SimulatorPlant: {', '.join(self._read['q'])}, every {self.period:g} s>"

    def run(self, position: np.ndarray, velocity: np.ndarray, seed: int = 0) -> Result:
        """What is simulated for positions (N, n) and speeds (N, n), as of a `Rig`; the seed draws noise.

        Raises ModelError for a result without the variables that are named, or without the times of the references, and what
        the simulator raises.
        """
        t = self.period * np.arange(len(position))
        references = (np.asarray(position, dtype=float), np.asarray(velocity, dtype=float))
        inputs = {
            name: Samples(t, column, kind="constant")
            for names, values in zip(self._inputs, references, strict=False)
            for name, column in zip(names, values.T, strict=True)
        }
        found = self._simulator(inputs, float(t[-1]))
        rows = np.searchsorted(found.time, t + LATE * self.period, side="right") - 1
        if np.abs(found.time[rows] - t).max() > LATE * self.period:
            late = int(np.argmax(np.abs(found.time[rows] - t)))
            raise ModelError(
                f"SimulatorPlant: found a result without {t[late]:g} s, expected one at all multiples of {self.period:g} "
                "s; communicate every period, or at fractions of it",
                argument="period",
            )
        read = {letter: [_scalar(name, found) for name in names] for letter, names in self._read.items()}
        true = {
            letter: np.column_stack([self._column(found, name)[rows] for name in names])
            for letter, names in read.items()
        }
        values = {f"q_ref[{k}]": column for k, column in enumerate(references[0].T)}
        values |= {f"v_ref[{k}]": column for k, column in enumerate(references[1].T)}
        run = Result(t, values, title=found.title)
        unit = found.unit(read["q"][0])
        return with_readings(run, true, unit, self.noise, np.random.default_rng(seed))

    def _column(self, found: Result, name: str) -> np.ndarray:
        if name not in found.names:
            raise ModelError(
                f"SimulatorPlant: found a result without {name}, expected it{did_you_mean(name, found.names)}"
            )
        return np.asarray(found[name], dtype=float)


def _scalar(name: str, found: Result) -> str:
    """The variable itself where the only element of a vector was meant, and it is none."""
    whole = name.removesuffix("[0]")
    return whole if name not in found.names and whole in found.names else name


def _elements(word: str, names: Names, count: int) -> Sequence[str]:
    """Names of elements, of one vector or as they are. Raises ModelError for another number."""
    found = [f"{names}[{k}]" for k in range(count)] if isinstance(names, str) else list(names)
    if len(found) != count:
        raise ModelError(
            f"SimulatorPlant: found {len(found)} names in {word}={names!r}, expected {count}", argument=word
        )
    return found
