"""Models that sample: simulate beside their FMU, stepped through FMPy from sample to sample."""

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau import Input, Model, Parameter, Real, Samples, der, sampled, simulate, translate
from gantrytau_fmu import export_fmu
from gantrytau_models import prototypes
from gantrytau_models.control.tracking import ControlledRobot
from tests.benchmarks.table import Row, at_most, in_turn, print_table

PERIOD = 0.004  # s
STOP = 16.0  # s
TOLERANCE = 1e-8
ROUNDS = 5
SAMPLES = round(STOP / PERIOD)


class MassUnderPi(Model):
    """A mass whose speed a discrete PI controller leads."""

    m = Parameter(2.0, unit="kg", description="mass")
    k = Parameter(40.0, unit="kg/s", description="gain")
    k_i = Parameter(90.0, unit="N/m", description="gain of the integral part")
    period = Parameter(PERIOD, unit="s", description="sampling period")
    wanted = Input(unit="m/s", start=0.0, description="wanted speed")
    x = Real(unit="m", start=0.0, fixed=True, description="position")
    v = Real(unit="m/s", start=0.0, fixed=True, description="speed")
    integral = Real(unit="N", start=0.0, description="integral part")
    f = Real(unit="N", start=0.0, description="force")

    def equations(self):
        error = self.wanted - self.v
        yield self.v == der(self.x)
        yield self.m * der(self.v) == self.f
        yield sampled(self.integral, self.integral + self.period * self.k_i * error, period=self.period)
        yield sampled(self.f, self.k * error + self.integral, period=self.period)


def rows() -> Iterator[Row]:
    """Milliseconds a sample, and how they compare with the FMU."""
    yield from _beside_fmu("a mass under PI", MassUnderPi(), ["wanted"], ["v"], 0.05)
    robot = ControlledRobot(prototypes.L1)
    references, places = ([f"{name}[{k}]" for k in range(3)] for name in ("r_ref", "r"))
    yield from _beside_fmu("ControlledRobot(L1)", robot, references, places, 1.0)


def _beside_fmu(
    title: str, model: Model, inputs: list[str], outputs: list[str], limit: float
) -> Iterator[Row]:
    dae = translate(model, events=True)
    start = [dae.start[name] for name in inputs]
    given = courses(inputs, start)
    with tempfile.TemporaryDirectory() as folder:
        stepped = Stepped(
            export_fmu(model, Path(folder) / "model.fmu", tolerance=TOLERANCE), inputs, outputs, start
        )
        ends: dict[str, Any] = {}

        def simulated() -> None:
            ends["simulate"] = simulate(dae, stop=STOP, inputs=given, tolerance=TOLERANCE, outputs=outputs)

        def by_fmu() -> None:
            ends["fmu"] = stepped.run()

        simulated()  # makes its functions, as the export has made the FMU
        times = in_turn({"simulate": simulated, "fmu": by_fmu}, ROUNDS)
        apart = np.abs(np.array([ends["simulate"].final(n) for n in outputs]) - ends["fmu"]).max()
        stepped.close()
    yield at_most(f"{title}, simulate, time of a sample", 1e3 * times["simulate"] / SAMPLES, limit, "ms")
    figure = f"{title}, {STOP:g} s at {TOLERANCE:g}, simulate against its FMU through FMPy"
    yield at_most(figure, times["simulate"] / times["fmu"], 1.0, "x")
    yield at_most(f"{title}, the ends of the two apart, in tolerances", apart / TOLERANCE, 100.0)


def courses(inputs: list[str], start: list[float]) -> dict[str, Samples]:
    """The inputs, held from sample to sample as those of an FMU."""
    t = np.arange(SAMPLES + 1) * PERIOD
    values = np.array([wanted(start, at) for at in t])
    return {n: Samples(t, values[:, k], kind="constant") for k, n in enumerate(inputs)}


def wanted(start: list[float], t: float) -> list[float]:
    """Inputs at a time in s, on sines of 1, 2 and 3 rad/s from rest."""
    return [first + 0.03 * (1 - np.cos((k + 1) * t)) for k, first in enumerate(start)]


class Stepped:
    """An FMI 3.0 slave in FMPy."""

    def __init__(self, path: Path, inputs: list[str], outputs: list[str], start: list[float]):
        import fmpy
        from fmpy.fmi3 import FMU3Slave

        description: Any = fmpy.read_model_description(str(path), validate=False)
        places = {variable.name: variable.valueReference for variable in description.modelVariables}
        self.inputs, self.outputs = [places[name] for name in inputs], [places[name] for name in outputs]
        self.courses = [wanted(start, k * PERIOD) for k in range(SAMPLES)]
        self.fmu: Any = FMU3Slave(
            guid=description.guid,
            unzipDirectory=fmpy.extract(str(path), str(path.with_suffix(""))),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="model",
        )
        self.fmu.instantiate()
        self._begin()

    def _begin(self) -> None:
        self.fmu.enterInitializationMode(startTime=0.0)
        self.fmu.exitInitializationMode()

    def run(self) -> np.ndarray:
        """The outputs at the end, every sample set, stepped and read from the start on."""
        fmu = self.fmu
        fmu.reset()
        self._begin()
        found = []
        for k, values in enumerate(self.courses):
            fmu.setFloat64(self.inputs, values)
            fmu.doStep(k * PERIOD, PERIOD)
            found.append(fmu.getFloat64(self.outputs))
        return np.array(found[-1])

    def close(self) -> None:
        """Release the library."""
        self.fmu.terminate()
        self.fmu.freeInstance()


if __name__ == "__main__":
    sys.exit(print_table("Sampling", [rows()]))
