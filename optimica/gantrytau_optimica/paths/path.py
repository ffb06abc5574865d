"""Paths in space for a robot's tool to follow, given by functions, points or a recording.

A path is a place r(s) over its arc length s in m, so that |dr/ds| = 1: der(s) is the speed of the tool and der(der(s))
its acceleration along the path; |d2r/ds2| is the curvature. A problem says that the tool is on it::

    class Along(Optimization):
        robot = GantryTau(prototypes.GT_A)
        way = Way(Path.through(points))
        given = ("robot.carts[2].f",)

        def equations(self):
            yield self.robot.tool.r == self.way.r

or, with `s = Real(unit="m")` of its own, `yield self.robot.tool.r == path(self.s)`. One force moves the tool, the others
follow, and all have their limits.
"""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import array, number
from gantrytau.border.refusal import USERS_ERRORS
from gantrytau.describing.record import Record
from gantrytau.language.declarations import Formula
from gantrytau.whole_files import replacing
from gantrytau_optimica.paths.fitting import (
    Array,
    Curve,
    PiecewisePolynomial,
    by_length,
    continued,
    line,
    nearest,
    rounded,
    spline,
)
from gantrytau_optimica.paths.points import (
    SHARP,
    check_different,
    checked_points,
    closed_points,
    coordinates,
    corner_error,
    direction,
    turns,
    words,
)
from gantrytau_optimica.paths.recording import FEWEST, corner_rows, smoothed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STRAIGHT = 1e-6  # rad: a polyline that turns by less goes straight on
BACK = np.radians(170.0)  # a corner that turns back further cannot be rounded
CRAMPED = 0.01  # share of the blend below which a corner counts as driven through
ACCURACY = 1e-7  # m: how far the pieces may be from the curve they stand for


@dataclass(frozen=True)
class Corner(Record):
    """A corner that was rounded. row: of the points given; point: (d,) in m; angle: by which the way turns, in rad;
    s: where the path passes it, in m; distance: of the path from the corner, in m.
    """

    row: int
    point: tuple[float, ...]
    angle: float
    s: float
    distance: float


@dataclass(frozen=True)
class Deviation(Record):
    """How far a recording is from its path. largest, rms: distance in m; row: of the point that is the furthest
    off; noise: standard deviation of a coordinate as differences of successive points show it, in m; left_out: rows
    of single points that are far from their neighbours, not followed and not counted.
    """

    largest: float
    rms: float
    row: int
    noise: float
    left_out: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class Path(Record):
    """A place over the arc length in m: call it with a number -> (d,), an array (k,) -> (k, d), or a symbol -> (d, 1).

    Made by `line`, `through`, `polyline`, `of` and `recorded`. pieces: polynomials of degree five, with continuous
    place, tangent and curvature; corners: those that were rounded; deviation: of a recording, else None.
    """

    pieces: PiecewisePolynomial
    corners: tuple[Corner, ...] = ()
    deviation: Deviation | None = None

    @classmethod
    def line(cls, start: Any, end: Any) -> "Path":
        """The straight line between two places (d,) in m. ModelError if they are the same, or no places."""
        points = checked_points("Path.line", [start, end])
        check_different("Path.line", points)
        return cls(line(*points))

    @classmethod
    def through(
        cls,
        points: Any,
        *,
        start_direction: Any = None,
        end_direction: Any = None,
        closed: bool = False,
        blend: float | None = None,
    ) -> "Path":
        """The cubic spline through points (n, 3) or (n, 2) in m, over the lengths of their chords.

        start_direction, end_direction: of the path there, (d,), of any length; without, its curvature there is zero.
        closed: come back to the first point smoothly, which may be repeated as the last. blend: largest distance in m
        from corners, points at which chords turn by more than 60 degrees; without, they are refused.
        Raises ModelError for corners, repeated points, and what is no points.
        """
        name = "Path.through"
        found = checked_points(name, points)
        if closed:
            ends = dict(start_direction=start_direction, end_direction=end_direction)
            found = closed_points(name, found, **ends, blend=blend)
        check_different(name, found)
        begin = direction(name, "start_direction", start_direction, found.shape[1])
        end = direction(name, "end_direction", end_direction, found.shape[1])
        angles = turns(np.vstack([found, found[1:2]]) if closed else found)
        if np.any(angles > SHARP) and blend is None:
            advice = "give points closer together if the curve is smooth there, round its corners with blend=0.01 (m)"
            raise corner_error(
                name, found, angles, SHARP, advice + ("" if not closed else " and closed=False")
            )
        rows = [0, *(np.flatnonzero(angles > SHARP) + 1), len(found) - 1]
        arcs = []
        for k, (a, b) in enumerate(pairwise(rows)):
            first, last = begin if k == 0 else None, end if k == len(rows) - 2 else None
            arcs.append(by_length(spline(found[a : b + 1], first, last, closed), ACCURACY, name))
        return cls._rounded(name, arcs, found, rows, angles, blend)

    @classmethod
    def polyline(cls, points: Any, *, blend: float | None = None) -> "Path":
        """Straight lines through points (n, 3) or (n, 2) in m, with corners rounded, from which the path stays no
        further than `blend` in m, closer where the lines are short. Raises ModelError for corners without blend.
        """
        name = "Path.polyline"
        found = checked_points(name, points)
        check_different(name, found)
        angles = turns(found)
        if np.any(angles > STRAIGHT) and blend is None:
            advice = "round the corners with blend=0.01 (m), take Path.through for a smooth curve"
            raise corner_error(name, found, angles, STRAIGHT, advice)
        rows = [0, *(np.flatnonzero(angles > STRAIGHT) + 1), len(found) - 1]
        arcs = [line(found[a], found[b]) for a, b in pairwise(rows)]
        return cls._rounded(name, arcs, found, rows, angles, blend)

    @classmethod
    def of(cls, function: Callable[[ca.SX], Any], start: float = 0.0, stop: float = 1.0) -> "Path":
        """A curve given as a function of a parameter between start and stop, in any unit: it gets a CasADi symbol and
        returns the two or three coordinates in m, such as lambda u: (cos(u), sin(u), 0.5).

        Raises ModelError for what is no such function, and for a curve with corners or jumps.
        """
        name = "Path.of"
        begin = number(name, "start", start)
        end = number(name, "stop", stop, above=begin)
        u = ca.SX.sym("u")
        try:
            column = coordinates(function(u))
            first = ca.jacobian(column, u)
            evaluate = ca.Function("curve", [u], [column, first, ca.jacobian(first, u)])
        except USERS_ERRORS as error:  # of a function that is not ours
            reason = str(error).splitlines()[-1] if str(error) else type(error).__name__
            raise ModelError(
                f"{name}: {reason}; expected a function of one symbol that returns coordinates"
            ) from error
        if column.numel() not in (2, 3):
            raise ModelError(f"{name}: found {column.numel()} coordinates, expected two or three, in m")
        curve = Curve(
            lambda at: np.array([np.array(d).T for d in evaluate(at[None, :])]),
            np.linspace(begin, end, 5),
        )
        return cls(by_length(curve, ACCURACY, name))

    @classmethod
    def recorded(cls, points: Any, *, tolerance: float | None = None) -> "Path":
        """A recording (n, 3) or (n, 2) in m, as a robot that is led by hand makes it: with noise, pauses, and
        points that repeat; smoothed.

        tolerance: the path has few pieces and is nearer than this to every point, in m; None: it is as
        smooth as the noise suggests, by generalised cross-validation. `.deviation` says how near it is; corners are
        rounded, and listed in `.corners`. Raises ModelError where no spline of moderate size is that near.
        """
        name = "Path.recorded"
        found = checked_points(name, points, FEWEST, "; Path.through takes few")
        if tolerance is not None:
            tolerance = number(name, "tolerance", tolerance, unit="m", above=0.0)
        if np.ptp(found, axis=0).max() == 0.0:
            raise ModelError(f"{name}: all {len(found)} points are the same, expected a way; record a motion")
        made = smoothed(found, tolerance, ACCURACY, name)
        corners = []
        for row, angle in corner_rows(np.delete(found, made.left_out, axis=0), made.noise):
            row += sum(out <= row for out in made.left_out)
            s = float(nearest(made.pieces, found[row : row + 1])[0])
            gap = float(np.linalg.norm(found[row] - made.pieces.derivative(np.array([s]))[0]))
            corners.append(Corner(row, tuple(found[row].tolist()), angle, s, gap))
        off = Deviation(made.largest, made.rms, made.row, made.noise, made.left_out)
        return cls(made.pieces, tuple(corners), off)

    @classmethod
    def _rounded(
        cls,
        name: str,
        arcs: list[PiecewisePolynomial],
        points: Array,
        rows: Sequence[int],
        angles: Array,
        blend: float | None,
    ) -> "Path":
        """Arcs between corners at the given rows, joined."""
        if len(arcs) == 1:
            return cls(arcs[0])
        distance = number(name, "blend", blend, unit="m", above=0.0)
        inner = [int(row) for row in rows[1:-1]]
        back = [row for row in inner if angles[row - 1] > BACK]
        if back:
            raise ModelError(
                f"{name}: points[{back[0]}] = {words(points[back[0]])} turns back by "
                f"{np.degrees(angles[back[0] - 1]):.0f} deg, which cannot be rounded; end the path there, and make "
                "the way back a path of its own"
            )
        pieces, places, gaps = rounded(arcs, distance, ACCURACY, name)
        small = int(np.argmin(gaps))
        if gaps[small] < CRAMPED * distance:
            row = inner[small]
            raise ModelError(
                f"{name}: beside points[{row}] = {words(points[row])} the way is too short to round the corner to more "
                f"than {gaps[small]:.2g} m, expected about blend={distance:g} m; leave out that point or its neighbour, "
                "or choose a smaller blend"
            )
        corners = [
            Corner(row, tuple(points[row].tolist()), float(angles[row - 1]), s, gap)
            for row, s, gap in zip(inner, places, gaps, strict=True)
        ]
        return cls(pieces, tuple(corners))

    def __repr__(self) -> str:
        rounded = (
            f", {len(self.corners)} corner{'s' * (len(self.corners) > 1)} rounded" if self.corners else ""
        )
        off = f", at most {self.deviation.largest:.2g} m from its recording" if self.deviation else ""
        return f"<Path of {self.length:.6g} m in {len(self.pieces.coefficients)} pieces{rounded}{off}>"

    @property
    def length(self) -> float:
        """In m."""
        return float(self.pieces.knots[-1])

    @property
    def dimension(self) -> int:
        """Two or three coordinates."""
        return self.pieces.coefficients.shape[2]

    def __call__(self, s: Any) -> Any:
        """The place in m at length s in m: of a number (d,), of an array (k,) (k, d), of a CasADi SX symbol (d, 1).

        A symbol has the unit m, and what comes of it, too. Numbers outside of 0 to `length` raise ModelError; symbols
        cannot: shortly beyond its ends the path goes on straight.
        """
        if isinstance(s, ca.SX):
            return self._symbolic(s)
        if isinstance(s, (ca.MX, Formula)):
            raise ModelError(
                f"Path: found {type(s).__name__}, expected a number, an array (k,) or a symbol of a model (SX), in m; "
                "name the path in equations(), not among the declarations"
            )
        found = self.derivative(s, 0)
        return found[0] if np.ndim(s) == 0 else found

    def at(self, s: Any) -> Array:
        """Places in m at lengths s (k,) in m, (k, d)."""
        return self.derivative(s, 0)

    def tangent(self, s: Any) -> Array:
        """Unit vectors along the path at lengths s (k,) in m, (k, d)."""
        first = self.derivative(s, 1)
        return first / np.linalg.norm(first, axis=1)[:, None]

    def curvature(self, s: Any) -> Array:
        """Curvature in 1/m at lengths s (k,) in m, (k,): the inverse of the radius."""
        tangent, second = self.tangent(s), self.derivative(s, 2)
        across = second - tangent * np.sum(tangent * second, axis=1)[:, None]
        return np.linalg.norm(across, axis=1)

    def derivative(self, s: Any, order: int = 1) -> Array:
        """The derivative by s of this order, in m^(1 - order), at lengths s (k,) in m, (k, d)."""
        found = np.atleast_1d(array("Path", "s", s, (), (None,), unit="m", finite=False))
        slack = 1e-9 * self.length
        wrong = found[~((found >= -slack) & (found <= self.length + slack))]
        if wrong.size:
            raise ModelError(
                f"found s = {wrong[0]:.6g} m, expected 0 to {self.length:.6g} m, the length of the path",
                place="Path",
                argument="s",
            )
        return self.pieces.derivative(found, order)

    def plot(self, file: str | os.PathLike[str] | None = None) -> "Figure":
        """The path in space or plane with its corners, beside its curvature; saved to `file` if one is named."""
        from matplotlib.figure import Figure

        figure = Figure(figsize=(9.0, 4.0), layout="constrained")
        s = np.linspace(0.0, self.length, max(400, 10 * len(self.pieces.knots)))
        axes: Any = figure.add_subplot(1, 2, 1, projection="3d" if self.dimension == 3 else None)
        axes.plot(*self.at(s).T)
        for corner in self.corners:
            axes.plot(*([x] for x in corner.point), "x", color="tab:red")
        axes.set_aspect("equal")
        for label, letter in zip(
            (axes.set_xlabel, axes.set_ylabel, getattr(axes, "set_zlabel", None)), "xyz", strict=True
        ):
            if label is not None:
                label(f"{letter} [m]")
        bend = figure.add_subplot(1, 2, 2)
        bend.plot(s, self.curvature(s))
        bend.set_xlabel("s [m]")
        bend.set_ylabel("curvature [1/m]")
        bend.grid(alpha=0.3)
        if file is not None:
            with replacing(file) as partial:
                figure.savefig(partial, dpi=150)
        return figure

    def _symbolic(self, s: ca.SX) -> ca.SX:
        """Coefficients are picked by sums of steps at the knots, whose derivatives are structurally zero."""
        if s.numel() != 1:
            raise ModelError(f"Path: found a symbol of shape {s.shape}, expected one length, in m; index it")
        # one metre, if s is in metres: powers of s would not have the unit of a place
        metre = ca.floor(1.5 + 1e-9 * s)
        u = s / metre
        pieces = continued(self.pieces)
        coefficients = pieces.coefficients
        columns = coefficients.reshape(len(coefficients), -1)
        start, *picked = _picked(u, pieces.knots, np.column_stack([pieces.knots[:-1], columns]))
        x, d = u - start, self.dimension
        place = []
        for k in range(d):
            value = ca.SX(0)
            for power in range(coefficients.shape[1] - 1, -1, -1):
                value = value * x + picked[power * d + k]
            place.append(value)
        return metre * ca.vertcat(*place)


def _picked(u: ca.SX, knots: Array, values: Array) -> list[ca.SX]:
    """The row of `values` (n, m) that belongs to the piece between `knots` (n + 1,) in which u is."""
    found = [ca.SX(value) for value in values[0]]
    for knot, jumps in zip(knots[1:-1], np.diff(values, axis=0), strict=True):
        behind = u >= knot
        found = [f if j == 0.0 else f + ca.if_else(behind, j, 0) for f, j in zip(found, jumps, strict=True)]
    return found
