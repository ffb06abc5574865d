"""What is shown: the values of a result at the instants of the pictures."""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gantrytau.border import checks
from gantrytau.border.refusal import ModelError
from gantrytau.dae import Dae
from gantrytau.language.self_description.appearance import ForceArrow, PathLine, Shape, Triad, Value
from gantrytau.results.result import Result
from gantrytau.results.series import Series

Rotations = str | np.ndarray | None  # a name, numbers (3, 3), or the axes of the world

RATE = 60.0  # Hz, of pictures
MOST = 1800  # pictures; slower where there would be more


@dataclass(frozen=True)
class Binding:
    """A variable at its limit from `begin` to `end`, s."""

    name: str
    begin: float
    end: float


@dataclass(frozen=True, eq=False)
class Film:
    """A result, or a pose, at times (N,) in s: those of the pictures, which follow one another by `step` s of the page.

    constants: numbers that the result does not hold, by name; shapes: what is seen, by the names of places; around: what
    stands around it, in numbers; failed: pictures (N,) of poses that cannot be, which are red; ghost: the same model where
    a controller plans to be, at the same times, seen through.
    """

    series: Series
    times: np.ndarray
    step: float
    constants: Mapping[str, Any] = field(default_factory=dict)
    bindings: tuple[Binding, ...] = ()
    shapes: tuple[Shape, ...] = ()
    around: tuple[Shape, ...] = ()
    failed: np.ndarray | None = None
    ghost: "Film | None" = None

    @property
    def title(self) -> str:
        """What was computed."""
        return self.series.title

    def values(self, what: Value, shape: tuple[int, ...] = ()) -> np.ndarray:
        """A quantity, a number, or a vector of either, at all times, (N, *shape)."""
        if isinstance(what, (list, tuple)) and (len(what),) == shape:
            return np.stack([self.values(part) for part in what], axis=-1)
        if not isinstance(what, str):
            return np.broadcast_to(self._numbers(what, shape), (self.times.size, *shape))
        if what not in self.series:
            return np.broadcast_to(self._constant(what, shape), (self.times.size, *shape))
        known, found = self.series.time, self._known(what)
        self._check(what, found[0], shape)
        found = found.reshape(known.size, -1)
        columns = [np.interp(self.times, known, column) for column in found.T]
        return np.stack(columns, axis=1).reshape(self.times.size, *shape)

    def _numbers(self, what: Value, shape: tuple[int, ...]) -> np.ndarray:
        """Numbers of a shape; ModelError for what has another one, or is not finite."""
        found = checks.array(self.title or "result", "shapes()", what)
        self._check(what, found, shape)
        return found

    def _check(self, what: Value, found: np.ndarray, shape: tuple[int, ...]) -> None:
        if found.shape != shape and np.isfinite(found).all():
            raise ModelError(
                f"{self.title or 'result'}: found {what!r} of shape {found.shape} in shapes(), expected one of shape "
                f"{shape}; a place is the name of a vector of three, or three of names and numbers"
            )

    def _known(self, name: str) -> np.ndarray:
        """A quantity at the times of the result; ModelError where it is not finite."""
        found = self.series[name]
        wrong = ~np.isfinite(found.reshape(len(found), -1)).all(axis=1)
        if wrong.any():
            row = int(np.argmax(wrong))
            raise ModelError(
                f"{self.title or 'result'}: found {name} = {found[row].tolist()} at {self.series.time[row]:g} s, expected "
                "finite numbers; show the part before, or mend the model"
            )
        return found

    def turned(self, R: Rotations, vector: Value) -> np.ndarray:
        """A vector given along the axes R, or those of the world, in the world, (N, 3)."""
        found = self.values(vector, (3,))
        return found if R is None else np.einsum("nij,nj->ni", self.rotations(R), found)

    def rotations(self, R: Rotations) -> np.ndarray:
        """Orientations at all times, (N, 3, 3): between those of the result by turning about one axis."""
        from scipy.spatial.transform import Rotation, Slerp

        if not isinstance(R, str) or R not in self.series:
            found = np.eye(3) if R is None else self.values(R, (3, 3))
            return np.broadcast_to(found, (self.times.size, 3, 3))
        known, rows = np.unique(self.series.time, return_index=True)
        self._check(R, self._known(R)[0], (3, 3))
        given = Rotation.from_matrix(self._known(R)[rows])
        if known.size == 1:
            return np.broadcast_to(given.as_matrix()[0], (self.times.size, 3, 3))
        return Slerp(known, given)(np.clip(self.times, known[0], known[-1])).as_matrix()

    def _constant(self, name: str, shape: tuple[int, ...]) -> np.ndarray:
        names = [f"{name}[{','.join(map(str, index))}]" for index in np.ndindex(*shape)] if shape else [name]
        try:
            return np.array([float(self.constants[one]) for one in names]).reshape(shape)
        except KeyError as error:
            raise ModelError(
                f"{self.title or 'result'}: found no {error.args[0]}, expected all that its shapes hang on; simulate the "
                "same model with all outputs"
            ) from None


def film_of(shown: Any, speed: float = 1.0, model: Dae | None = None, around: Sequence[Any] = ()) -> Film:
    """What is to be shown of a Result or an optimum. speed: seconds of the motion in a second of the page; model: whose
    motion it is, where that does not say it; around: obstacles and whatever else has `shapes()` in numbers.

    Raises ModelError for what has no motion in it, or nothing that could be seen.
    """
    series = series_of("animate", shown)
    constants = dict(getattr(shown, "parameters", {}))
    shapes = series.shapes
    if model is not None and not shapes:
        root = _root(series, model.flat.shapes)
        shapes = tuple(shape.within(root) if root else shape for shape in model.flat.shapes)
        own = {f"{root}.{name}" if root else name: value for name, value in model.parameter_values.items()}
        constants = {**own, **constants}
    if not shapes:
        whose = (
            ""
            if model is not None
            else "; of a result that was read from a file, say whose it is, animate(..., model=...)"
        )
        raise ModelError(
            f"{series.title or 'result'}: found nothing that could be shown, expected components of mechanics.multibody, or "
            f"a method shapes() of the model{whose}"
        )
    first, last = series.time[0], series.time[-1]
    pictures = int(np.clip(np.ceil((last - first) / speed * RATE), 1, MOST)) if last > first else 0
    step = (last - first) / speed / max(pictures, 1)
    arcs: Sequence[Any] = getattr(shown, "arcs", ())
    bindings = tuple(Binding(arc.name, arc.begin, arc.end) for arc in arcs if arc.side in ("max", "min"))
    times = np.linspace(first, last, pictures + 1)
    planned = getattr(shown, "planned", None)  # of a closed loop
    bodies = tuple(shape for shape in shapes if not isinstance(shape, (ForceArrow, PathLine, Triad)))
    ghost = Film(planned, times, step, constants, (), bodies) if isinstance(planned, Result) else None
    return Film(series, times, step, constants, bindings, shapes, tuple(surroundings(around)), ghost=ghost)


def series_of(verb: str, shown: Any) -> Result:
    """The result in what simulate, optimize or plan_calibration returned; ModelError for something else."""
    moved = getattr(shown, "motion", None)  # of a plan
    series = (
        shown if isinstance(shown, Series) else moved() if callable(moved) else getattr(shown, "result", None)
    )
    if isinstance(shown, (str, os.PathLike)):
        words = f"{verb}: found the file {shown}, expected what simulate or optimize returned; the command `gantrytau "
        raise ModelError(f"{words}browse {shown}` shows a saved result")
    if not isinstance(series, Result):
        raise ModelError(
            f"{verb}: found {type(shown).__name__}, expected what simulate or optimize returned; view(model) shows a pose"
        )
    return series


def _root(series: Series, shapes: Sequence[Shape]) -> str:
    """Where a model stands in what the result is of: `robot` of an optimum of it, or nowhere."""
    names = [name for shape in shapes for name in shape.names]
    ends = sorted(name for name in series.names if any(name.endswith(f".{end}") for end in names))
    if any(name in series for name in names) or not ends:
        return ""
    return next(one[: -len(end) - 1] for one in ends for end in names if one.endswith(f".{end}"))


def scalars_of(values: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
    """Scalars by name of values that may be arrays."""
    for name, value in values.items():
        array = np.asarray(value, dtype=float)
        for index in np.ndindex(*array.shape):
            yield (f"{name}[{','.join(map(str, index))}]" if index else name), float(array[index])


def surroundings(around: Any) -> Iterator[Shape]:
    """The shapes of what stands around; ModelError for what has none."""
    for one in around if isinstance(around, (list, tuple)) else [around]:
        if isinstance(one, Shape):
            yield one
        elif callable(getattr(one, "shapes", None)) and not isinstance(one, type):
            yield from one.shapes()
        else:
            raise ModelError(
                f"around: found {type(one).__name__}, expected obstacles, as Box(low, high) of gantrytau.kinematics, "
                "a workspace, or shapes in numbers"
            )
