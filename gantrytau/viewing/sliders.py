"""Poses on sliders: the values of each slider, the pose at each choice of them, and why some cannot be."""

import contextlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from gantrytau.answers.evaluation import given_scalars
from gantrytau.border.checks import instance, number
from gantrytau.border.refusal import Given, InitializationError, ModelError, StructureError
from gantrytau.dae import Dae
from gantrytau.language.self_description.appearance import ForceArrow, PathLine
from gantrytau.progress import Progress
from gantrytau.results.result import Result
from gantrytau.simulation.between.passed_limits import limited
from gantrytau.simulation.to_result import displays, labels
from gantrytau.viewing.assembled import assembled
from gantrytau.viewing.film import Film, scalars_of, surroundings
from gantrytau.viewing.page import page

STYLES, SCRIPTS = ("page.css", "poses.css"), ("frame.js", "poses.js")
STEPS = (161, 31, 11, 6)  # places of each of one, two, three, four sliders
REASONS = 4  # choices for which it is asked why they cannot be
COORDINATES = {"rad": np.pi, "m": 0.5}  # what is moved if nothing else is said, and how far from the start


@dataclass(frozen=True, eq=False)
class Slider:
    """A scalar variable or parameter that is moved: its values (n,) in SI, and the place of its start among them."""

    name: str
    values: np.ndarray
    start: int


@dataclass(frozen=True, eq=False)
class PoseGrid:
    """A model at all choices of its sliders, of each assembly one after the other, the last slider fastest.

    failed: which choices cannot be, which show the nearest that can; reasons: why, by some of their numbers.
    """

    assemblies: tuple[str, ...]
    film: Film
    failed: np.ndarray
    reasons: Mapping[int, str]


class Posing:
    """A model that is put into poses: values of sliders -> a film of them.

    pose: values of other variables; assemblies: start values of each way to assemble it, by its name.
    """

    def __init__(
        self,
        dae: Dae,
        sliders: Any,
        pose: Mapping[str, Any],
        assemblies: Mapping[str, Mapping[str, Any]] | None,
        around: Sequence[Any],
    ):
        self.dae, self.around = dae, tuple(surroundings(around))
        self.pose = given_scalars(dae, pose)
        instance(
            "view",
            "configurations",
            assemblies or {},
            Mapping,
            "start values by name, {'up': {'rod.phi': 1.2}}",
        )
        starts = dict(assemblies or {"": {}})
        self.daes = {name: dae.with_starts(own) if own else dae for name, own in starts.items()}
        # forces are not decided by positions, and a line joins places of one motion
        self.shapes = tuple(s for s in dae.flat.shapes if not isinstance(s, (ForceArrow, PathLine)))
        if not self.shapes:
            raise ModelError(
                f"{dae.name}: found nothing that could be shown, expected a method shapes() of the model"
            )
        self.sliders = _sliders(dae, sliders, self.pose)
        self.names = list(dict.fromkeys(name for shape in self.shapes for name in shape.names))
        self._rest = self._stays()
        self._functions = {name: self._function(own) for name, own in self.daes.items()}

    def _stays(self) -> dict[str, float]:
        """What keeps its value: the pose, and coordinates that are states where all that is moved are such."""
        moved = {slider.name for slider in self.sliders} - self.dae.parameter_values.keys() | self.pose.keys()
        own = {
            n
            for n in self.dae.states
            if "/s" not in (self.dae.flat.unit(n) or "") and not n.startswith("der(")
        }
        if len(moved) > len(own):
            words = f"expected at most {len(own)} of them and of the pose together, which is its mobility"
            raise ModelError(words, place=f"{self.dae.name}: view", found=Given("sliders", sorted(moved)))
        start = dict(scalars_of(self.dae.evaluate())) if moved <= own != moved else {}
        return {**{name: start[name] for name in sorted(own - moved) if start}, **self.pose}

    def _function(self, dae: Dae) -> Callable[[np.ndarray], np.ndarray]:
        """Values of the sliders (N, k) -> all that the shapes hang on, (N, m)."""
        known = [*(slider.name for slider in self.sliders), *self._rest]
        try:
            function = dae.array_function(known, self.names)
        except StructureError:  # what is given leaves more open than arrays can
            return partial(self._one_by_one, dae)

        def found(columns: np.ndarray) -> np.ndarray:
            given = [*columns.T, *(np.full(len(columns), value) for value in self._rest.values())]
            return np.hstack([a.reshape(len(columns), -1) for a in function.around(*given)])

        return found

    def _one_by_one(self, dae: Dae, columns: np.ndarray) -> np.ndarray:
        """The same by `evaluate`, which completes what is left open from the start."""
        scalars = [name for whole in self.names for name in dae.expand(whole)]
        rows = np.full((len(columns), len(scalars)), np.nan)
        with Progress("view", 0, len(columns)) as progress:
            for k, (row, chosen) in enumerate(zip(rows, columns, strict=True)):
                progress.at(k)
                with contextlib.suppress(InitializationError):
                    values = dict(scalars_of(dae.evaluate(self._named(chosen))))
                    row[:] = [values[name] for name in scalars]
        return rows

    def _named(self, row: np.ndarray) -> dict[str, float]:
        chosen = {slider.name: float(x) for slider, x in zip(self.sliders, row, strict=True)}
        return {**self.pose, **chosen}

    def found(self, assembly: str, columns: np.ndarray) -> np.ndarray:
        """All that the shapes hang on, (N, m), at values of the sliders (N, k); NaN in rows that cannot be."""
        return self._functions[assembly](columns)

    def why(self, assembly: str, row: np.ndarray) -> str:
        """Why a pose cannot be."""
        try:
            self.daes[assembly].evaluate(self._named(row))
        except (InitializationError, ModelError) as error:
            return str(error).partition(". Expected")[0]
        return f"{self.dae.name}: the way from the start does not lead there; another assembly may"

    def film(self, rows: np.ndarray, failed: np.ndarray | None = None) -> Film:
        """What is seen where the shapes hang on these values, (N, m), a second for each row; failed: rows that are red."""
        scalars = [name for whole in self.names for name in self.dae.expand(whole)]
        values = dict(zip(scalars, rows.T, strict=True))
        constants = {n: float(v) for n, v in self.dae.parameter_values.items() if n not in values}
        times = np.arange(float(len(rows)))
        series = Result(times, {**constants, **values}, title=self.dae.name, shapes=self.shapes)
        return Film(series, times, 1.0, {}, (), self.shapes, self.around, failed)

    @property
    def ends(self) -> np.ndarray:
        """The values of the sliders at the start, and with each at its ends, (1 + 2 k, k)."""
        start = np.array([slider.values[slider.start] for slider in self.sliders])
        rows = [start]
        for place, slider in enumerate(self.sliders):
            rows += [np.where(np.arange(start.size) == place, end, start) for end in slider.values[[0, -1]]]
        return np.array(rows)

    def shown(self) -> list[dict[str, Any]]:
        """Name, unit, description, values and start of each slider, as they are read."""
        units, words = labels(self.dae)
        own = displays(self.dae)
        told = []
        for slider in self.sliders:
            kept = Result(
                np.arange(float(slider.values.size)),
                {slider.name: slider.values},
                units={slider.name: units.get(slider.name, "")},
                displays={slider.name: own.get(slider.name, "")},
            )
            values, unit = kept.shown(slider.name)[slider.name]
            told.append(
                dict(
                    name=slider.name,
                    unit=unit,
                    words=words.get(slider.name, ""),
                    values=values.tolist(),
                    start=slider.start,
                )
            )
        return told

    def everywhere(self) -> PoseGrid:
        """The poses at all choices. Raises InitializationError if none can be."""
        grid = np.stack(np.meshgrid(*(s.values for s in self.sliders), indexing="ij"), axis=-1)
        columns, shape = grid.reshape(-1, len(self.sliders)), grid.shape[:-1]
        rows, failed, reasons = [], [], dict[int, str]()
        for name in self.daes:
            found = self.found(name, columns)
            wrong = np.array(~np.isfinite(found).all(axis=1))
            if wrong.all():
                raise InitializationError(self.why(name, columns[0]))
            first = len(columns) * len(rows)
            numbers = np.flatnonzero(wrong)
            for k in (
                numbers[np.unique(np.linspace(0, numbers.size - 1, REASONS).astype(int))]
                if numbers.size
                else ()
            ):
                reasons[first + int(k)] = self.why(name, columns[k])
            rows.append(found[_nearest(wrong.reshape(shape))])
            failed.append(wrong)
        red = np.concatenate(failed)
        return PoseGrid(tuple(self.daes), self.film(np.vstack(rows), red), red, reasons)


def poses_page(posing: Posing) -> str:
    """The HTML of a model with sliders, whose poses are all in it."""
    if len(posing.sliders) > len(STEPS):
        words = f"expected at most {len(STEPS)} of them, or live=True, which computes each pose when it is asked for"
        raise ModelError(
            words, place="view", found=Given("sliders", [slider.name for slider in posing.sliders])
        )
    poses = posing.everywhere()
    shown = posing.shown()
    for one in shown:
        one["values"] = [float(f"{x:.6g}") for x in one["values"]]
    data = dict(
        sliders=shown,
        assemblies=poses.assemblies,
        failed=np.flatnonzero(poses.failed).tolist(),
        reasons=poses.reasons,
    )
    text = json.dumps(data).replace("<", "\\u003c")
    scene = page([poses.film], [""], posing.dae.name)
    return assembled(posing.dae.name, "poses.html", [text], scene, STYLES, SCRIPTS)


def _nearest(wrong: np.ndarray) -> np.ndarray:
    """The number of the nearest choice that can be, of each, (N,)."""
    from scipy.ndimage import distance_transform_edt

    indices = distance_transform_edt(wrong, return_distances=False, return_indices=True)
    return np.ravel_multi_index(tuple(np.array(indices)), wrong.shape).ravel()


def _sliders(dae: Dae, given: Any, pose: Mapping[str, float]) -> tuple[Slider, ...]:
    """The sliders that are asked for, by names with or without ranges; True: the coordinates that are states."""
    if given is True:
        given = [name for name in dae.states if dae.flat.unit(name) in COORDINATES]
    expected = "names, or ranges by name, {'crank.phi': ('-90 deg', '90 deg')}"
    instance("view", "sliders", given, (Mapping, list, tuple), expected)
    ranges = dict(given) if isinstance(given, Mapping) else dict.fromkeys(given)
    if not ranges:
        raise ModelError(f"expected {expected}", place="view", found=Given("sliders", given))
    steps = STEPS[min(len(ranges), len(STEPS)) - 1]
    start = {**dae.parameter_values, **dict(scalars_of(dae.evaluate()))}
    return tuple(_slider(dae, name, limits, steps, {**start, **pose}) for name, limits in ranges.items())


def _slider(dae: Dae, name: str, limits: Any, steps: int, start: Mapping[str, float]) -> Slider:
    scalar, *others = dae.expand(name)
    if others:
        raise ModelError(f"expected a scalar, such as {scalar}", place="view", found=Given("sliders", name))
    own = start[scalar]
    low, high = _range(dae, scalar, own) if limits is None else _told(dae, name, limits)
    values = np.linspace(low, high, steps)
    if low < own < high:  # the pose at the start is one of them
        values[np.argmin(np.abs(values - own))] = own
    return Slider(scalar, values, int(np.argmin(np.abs(values - own))))


def _told(dae: Dae, name: str, limits: Any) -> tuple[float, float]:
    """A range that is given, in SI."""
    if not (isinstance(limits, (tuple, list)) and len(limits) == 2):
        words = "expected the lowest and the highest value, (low, high)"
        raise ModelError(words, place="view: sliders", found=Given(name, limits))
    unit = dae.flat.unit(name)
    low = number("view: sliders", name, limits[0], unit=unit)
    return low, number("view: sliders", name, limits[1], unit=unit, above=low)


def _range(dae: Dae, name: str, own: float) -> tuple[float, float]:
    """The limits of a declaration; for want of them some way about the start, for a parameter half of it."""
    told = {side: dae.number(limit) for other, side, _, limit in limited(dae.flat) if other == name}
    way = abs(own) / 2 if name in dae.parameter_values else COORDINATES.get(str(dae.flat.unit(name)), 0.5)
    way = way or 0.5
    low, high = told.get("min", own - way), told.get("max", own + way)
    if low < high:
        return low, high
    return (low, low + 2 * way) if "min" in told else (high - 2 * way, high)  # it starts beyond its limit
