"""The controller with a virtual clock: ten thousand samples of the three-link robot under a law, with three clients."""

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gantrytau_fmu import export_fmu
from gantrytau_fmu.controller import Channel, Controller, Declaration, Sample
from gantrytau_models import MeasuredGantryTau, TrackingController, prototypes
from tests.benchmarks.table import Row, at_most, in_turn, print_table

SAMPLES, PERIOD, ROUNDS = 10_000, 0.004, 3
TARGET = [1.0, 3.0, -0.35]  # m
WIRES = {f"f[{k}]": f"carts[{k}].f" for k in range(3)}


class Corrections:
    """A client in this process that answers each sample with three numbers."""

    sends = Declaration([Channel("delta", "m", 3)])

    def __init__(self, name: str):
        self.name, self._last = name, list[Sample]()

    def submit(self, sample: Sample, declaration: Declaration) -> None:
        """Answer it."""
        self._last = [
            *self._last[-1:],
            Sample(sample.k, sample.time, 1e-3 * np.sin(0.01 * sample.k + np.arange(3))),
        ]

    def answer(self, k: int) -> Sample | None:
        """What it said to sample k - 1."""
        return next((sample for sample in self._last if sample.k == k - 1), None)

    def settled(self, k: int) -> bool:
        """It answers at once."""
        return True

    def close(self) -> None:
        """Nothing is held."""


def rows() -> Iterator[Row]:
    """Seconds of the whole run, its log in a file included."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        plant = export_fmu(MeasuredGantryTau(prototypes.L1), folder / "robot.fmu")
        law = export_fmu(TrackingController(prototypes.L1), folder / "law.fmu", find=["f"])

        def run() -> None:
            clients = [Corrections(client) for client in "abc"]
            parameters = {Channel("r_ref", "m", 3): TARGET}
            controller = Controller(plant, law, clients=clients, parameters=parameters, wires=WIRES)
            found = controller.run(SAMPLES * PERIOD, log=folder / "log.jsonl")
            assert all(found.timing.clients[client].taken == SAMPLES for client in "abc")

        times = in_turn({"run": run}, ROUNDS)
        figure = (
            "controller, virtual clock: 10,000 samples of the robot, law and robot as FMUs, three clients"
        )
        yield at_most(figure, times["run"], 5.0, "s")


if __name__ == "__main__":
    sys.exit(print_table("Controller", [rows()]))
