"""A plant that runs by itself, as `Controller` of gantrytau_fmu does, and its scalars by the names of the controller."""

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

from gantrytau import ModelError, Result
from gantrytau.border.dimensions import dimension
from gantrytau.border.refusal import Given, did_you_mean
from gantrytau.simulation.to_result import labels
from gantrytau_optimica.problem.optimization import Optimization

Law = Callable[[float, Mapping[str, float]], Mapping[str, float]]


@runtime_checkable
class DrivenPlant(Protocol):
    """What has samples of its own, and asks a law for inputs at every so many of them: an FMU, a robot, hardware.

    period: s, between samples; plant_inputs: scalars that a law may give, with their units, or None, where a controller of
    its own follows what the law gives under any names, a period of the law later; plant_outputs: what is measured.
    """

    @property
    def period(self) -> float: ...
    @property
    def plant_inputs(self) -> Mapping[str, str] | None: ...
    @property
    def plant_outputs(self) -> Mapping[str, str]: ...

    def under(
        self, law: Law, *, every: int, known: Sequence[str], gives: Mapping[str, str], stop: float
    ) -> Result:
        """Run until stop, s: law(t, {known: value}) -> {name: value}, gives: name -> unit; what was applied is in the
        result, at every sample of the plant, as `applied.name`, or as `mpc.name` with a controller of its own.
        """
        ...


def check_problem(plant: Any, wires: Any) -> None:
    """ModelError for a plant that is neither a problem nor one that runs by itself."""
    kind = plant if isinstance(plant, type) else type(plant)
    if plant is not None and not issubclass(kind, Optimization):
        source = f"'{plant}'" if isinstance(plant, (str, os.PathLike)) else "plant"
        words = f"Controller({source}, period=...) of gantrytau_fmu.controller, for FMUs and models"
        if hasattr(plant, "at_rest"):  # a Rig
            words = (
                "of a rig: loop, starts = rig.at_rest(q); Controller(loop, period=rig.period, starts=starts)"
            )
        words = f"expected the same problem with other parameters, or a plant that runs by itself: {words}"
        raise ModelError(words, place="run", found=Given("plant", plant))
    if wires:
        words = "found some and a problem as plant, expected them with one that runs by itself: names are the same here"
        raise ModelError(words, place="run", argument="wires")


def check_fit(mpc: Any, plant: DrivenPlant) -> int:
    """Samples of a plant in a period of an Mpc; ModelError where these or the delay do not fit."""
    every = round(mpc.period / plant.period)
    if every < 1 or abs(mpc.period - every * plant.period) > 1e-9 * plant.period:
        nearest = max(every, 1) * plant.period
        raise ModelError(
            f"found a period of {mpc.period:g} s and a plant with samples every {plant.period:g} s, expected a multiple of "
            f"these; Mpc(..., period={nearest:.6g})",
            place=mpc.name,
        )
    if plant.plant_inputs is None and not mpc.delay:
        raise ModelError(
            "found delay=0 and a plant whose controller takes answers a period later, expected delay=1; "
            "Mpc(..., delay=1), or a plant without a controller of its own",
            place=mpc.name,
        )
    return every


def joined(
    mpc: Any, kind: str, names: Sequence[str], there: Mapping[str, str], wires: Mapping[str, str]
) -> dict[str, str]:
    """For each name of an Mpc the plant's: that of `wires`, the same, or the same without its first word.

    kind: "input" or "output". ModelError for what the plant lacks, or has in another unit.
    """
    units, found = labels(mpc.built.read.dae)[0], dict[str, str]()
    for name in names:
        plain = wires.get(name, name)
        short = plain.partition(".")[2]
        own = next((one for one in (plain, short) if one in there), None)
        if own is None:
            verb = "gives" if kind == "input" else "measures"
            raise ModelError(
                f"found no {kind} '{plain}' of the plant, which the controller {verb}; wires={{'{name}': name in "
                f"the plant}} joins it with another{did_you_mean(short or plain, there)}",
                place=mpc.name,
                argument="plant",
            )
        if dimension(units.get(name, "1")) != dimension(there[own] or "1"):
            raise ModelError(
                f"{name} is in {units.get(name, '1')} and {own} of the plant in {there[own]}, expected one unit; join it "
                f"with another by wires={{'{name}': name in the plant}}",
                place=mpc.name,
                argument="plant",
            )
        found[name] = own
    return found
