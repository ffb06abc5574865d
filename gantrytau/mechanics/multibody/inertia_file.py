"""Masses, centres and inertias of bodies from a CSV file, as programs for design write them."""

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np

from gantrytau.describing.record import Record
from gantrytau.errors import ModelError, did_you_mean
from gantrytau.language.model import Declared
from gantrytau.language.scales import Scale, column_of, known_scale
from gantrytau.language.settings import with_setting
from gantrytau.language.tables.csv_cells import check_cells, number_of, read_cells

Robot = TypeVar("Robot", bound=Declared)

NAME = ("name", "body", "part")
MASS = ("m", "mass")
CENTRE = (("x", "r_cm[0]", "x_cm"), ("y", "r_cm[1]", "y_cm"), ("z", "r_cm[2]", "z_cm"))
DIAGONAL = (("Jxx", "J[0,0]", "Ixx"), ("Jyy", "J[1,1]", "Iyy"), ("Jzz", "J[2,2]", "Izz"))
PRODUCTS = {
    (0, 1): ("Jxy", "J[0,1]", "Ixy", "Jyx", "J[1,0]", "Iyx"),
    (0, 2): ("Jxz", "J[0,2]", "Ixz", "Jzx", "J[2,0]", "Izx"),
    (1, 2): ("Jyz", "J[1,2]", "Iyz", "Jzy", "J[2,1]", "Izy"),
}
EXAMPLE = (
    "name, m [kg], x [mm], y [mm], z [mm], Jxx [kg.mm2], and Jyy, Jzz, Jxy, Jxz, Jyz with this unit each"
)
ROUNDED = 1e-3  # of the trace, by which printed inertias may miss what a body can have, as Body allows
SMALLEST = -1e-9  # of the trace: eigenvalues of a thin rod are zero
FAR = 50.0  # m, a radius of gyration above which a unit is wrong


@dataclass(frozen=True, eq=False)
class Inertias(Record, Mapping[str, Mapping[str, Any]]):
    """Bodies by name, each with m in kg, r_cm (3,) in m and J (3, 3) in kg.m2 about its centre of mass.

    A mapping of modifications: `Crank(**found)`, `Body(**found["rod"])`. bodies: those; source: the file.
    """

    bodies: Mapping[str, Mapping[str, Any]]
    source: str = ""

    def __getitem__(self, name: str) -> Mapping[str, Any]:
        if name not in self.bodies:
            raise ModelError(
                f"{self.source}: there is no body '{name}'{did_you_mean(str(name), self.bodies)}"
            )
        return self.bodies[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.bodies)

    def __len__(self) -> int:
        return len(self.bodies)

    def __contains__(self, name: object) -> bool:
        return name in self.bodies

    @property
    def parameters(self) -> dict[str, Any]:
        """All numbers by full names, `arms[0].rod.J`, as `simulate(..., parameters=)` takes them."""
        return {f"{name}.{key}": value for name, body in self.items() for key, value in body.items()}

    def given_to(self, model: Robot) -> Robot:
        """A copy of a model whose bodies have these values; names may be dotted, as "carts[0].body".

        Raises ModelError for a name that is no part of the model, or no body.
        """
        for name, value in self.parameters.items():
            try:
                model = with_setting(model, name, value)
            except ModelError as error:
                raise ModelError(f"{self.source}: {error}") from error
        return model


def read_inertias(
    path: str | os.PathLike[str],
    *,
    about: Literal["centre", "frame"] = "centre",
    products: Literal["tensor", "integrals"] = "tensor",
) -> Inertias:
    """Bodies of a CSV file: a line for each, named columns with units, `m [kg]`, `x [mm]`, `Jxx [kg.mm2]`; SI without any.

    Columns: name; m; x, y, z of the centre of mass in the frame of the body, 0 if all three are missing; Jxx, Jyy, Jzz, Jxy,
    Jxz, Jyz of the inertia along the axes of that frame, the last three 0 if all are missing. Others are left alone. Cells
    are separated by commas, or by semicolons or tabs: then decimals may have a comma.
    about: the point of the inertias, the "centre" of mass, or the origin of the "frame", from which they are brought to the
    centre. products: Jxy and the like are elements of the "tensor", or "integrals" of x y dm, which are their negatives.

    Raises ModelError, with file and line, for what cannot be read, two bodies of a name, and what no body can have: a mass
    that is not above zero, an inertia that is not positive definite (semidefinite for a thin rod), principal moments of
    which one exceeds the sum of the others, units that measure something else.
    """
    _choice("about", about, ("centre", "frame"))
    _choice("products", products, ("tensor", "integrals"))
    file = Path(path)
    rows, separator = read_cells(file)
    if len(rows) < 2:
        raise ModelError(
            f"{file}: found {len(rows)} lines, expected a header, {EXAMPLE}, and a line for each body"
        )
    table = _Columns(file, rows[0][1], separator)
    bodies: dict[str, dict[str, Any]] = {}
    lines: dict[str, int] = {}
    for line, row in rows[1:]:
        check_cells(file, line, row, len(table.header), separator)
        name = row[table.name].strip()
        if not name:
            raise ModelError(f"{file}: line {line}: found no name, expected that of a body, as carts[0].body")
        if name in lines:
            raise ModelError(
                f"{file}: line {line}: found '{name}' a second time, after line {lines[name]}, expected each body once"
            )
        lines[name] = line
        bodies[name] = _body(f"{file}: line {line}: {name}", table, line, row, (about, products))
    return Inertias(bodies, str(file))


def _choice(name: str, value: Any, known: tuple[str, ...]) -> None:
    if value not in known:
        raise ModelError(
            f"read_inertias: found {name}={value!r}, expected {' or '.join(map(repr, known))}", argument=name
        )


class _Columns:
    """Where the numbers of a body stand, and in which units."""

    def __init__(self, file: Path, header: list[str], separator: str):
        self.file, self.separator = file, separator
        self.header, scales = [], []
        for text in header:
            heading, scale = _column(file, text)
            self.header.append(heading)
            scales.append(scale)
        self.scales: list[Scale | None] = scales
        self.name = self._place(NAME)
        self.mass = self._place(MASS, "kg")
        self.centre = self._all_or_none(CENTRE, "m")
        self.diagonal = [self._place(names, "kg.m2") for names in DIAGONAL]
        self.products = self._all_or_none(tuple(PRODUCTS.values()), "kg.m2")
        for places in (self.centre or [], [*self.diagonal, *(self.products or [])]):
            self._check_units(places)

    def _found(self, names: tuple[str, ...], unit: str | None = None) -> int | None:
        """The place of a column by one of its names, in any letters; ModelError for two, and for another unit."""
        wanted = {name.lower() for name in names}
        places = [k for k, heading in enumerate(self.header) if heading.replace(" ", "").lower() in wanted]
        if len(places) > 1:
            told = " and ".join(self.header[k] for k in places)
            raise ModelError(f"{self.file}: found the columns {told}, expected one of them; delete the other")
        if places and (scale := self.scales[places[0]]) is not None and unit is not None:
            known_scale(f"{self.file}: column {self.header[places[0]]}", scale.text, unit)
        return places[0] if places else None

    def _place(self, names: tuple[str, ...], unit: str | None = None) -> int:
        place = self._found(names, unit)
        if place is None:
            raise ModelError(
                f"{self.file}: found no column {names[0]}, expected {EXAMPLE}{did_you_mean(names[0], self.header)}"
            )
        return place

    def _all_or_none(self, names: tuple[tuple[str, ...], ...], unit: str) -> list[int] | None:
        found = [self._found(each, unit) for each in names]
        places = [place for place in found if place is not None]
        if places and len(places) < len(names):
            lost = ", ".join(each[0] for each, place in zip(names, found, strict=True) if place is None)
            raise ModelError(
                f"{self.file}: found no column {lost}, expected {', '.join(each[0] for each in names)}, all or none"
            )
        return places or None

    def _check_units(self, places: list[int]) -> None:
        """ModelError for columns of one kind of which some have a unit: nobody means a y in m beside an x in mm."""
        units = {self.header[place]: self.scales[place] for place in places}
        said = next(((name, unit.text) for name, unit in units.items() if unit is not None), None)
        bare = [name for name, unit in units.items() if unit is None]
        if said is not None and bare:
            raise ModelError(
                f"{self.file}: found {said[0]} in {said[1]} and {', '.join(bare)} without a unit, expected units of all "
                f"of them or of none; write '{bare[0]} [{said[1]}]'"
            )

    def numbers(self, line: int, row: list[str], places: list[int] | None) -> np.ndarray:
        """The numbers of three columns in SI, zeros where there are none; ModelError for what is empty or not finite."""
        return np.array([self.number(line, row, place) for place in places]) if places else np.zeros(3)

    def number(self, line: int, row: list[str], place: int) -> float:
        """One of them."""
        heading = self.header[place]
        found = number_of(self.file, line, heading, row[place], self.separator)
        if not np.isfinite(found):
            what = f"'{row[place].strip()}'" if row[place].strip() else "an empty cell"
            raise ModelError(f"{self.file}: line {line}, column {heading}: found {what}, expected a number")
        scale = self.scales[place]
        return found if scale is None else float(scale.si(found))


def _column(file: Path, text: str) -> tuple[str, Scale | None]:
    """Name and unit of a heading; elements as J[0,1] are no units."""
    try:
        return column_of(text)
    except ModelError as error:
        raise ModelError(f"{file}: {error}") from None


def _body(place: str, table: _Columns, line: int, row: list[str], ways: tuple[str, str]) -> dict[str, Any]:
    """The modifications of a Body; place: for messages; ways: about and products, as `read_inertias` has them."""
    about, products = ways
    m, r = table.number(line, row, table.mass), table.numbers(line, row, table.centre)
    J = np.diag(table.numbers(line, row, table.diagonal))
    for (i, k), value in zip(PRODUCTS, table.numbers(line, row, table.products), strict=True):
        J[i, k] = J[k, i] = -value if products == "integrals" else value
    if m <= 0:
        raise ModelError(f"{place}: found a mass of {m:g} kg, expected one above zero")
    if about == "frame":  # parallel axes
        J = J - m * (r @ r * np.eye(3) - np.outer(r, r))
    _check(place, m, J, about)
    return dict(m=m, r_cm=r.tolist(), J=J)


def _check(place: str, m: float, J: np.ndarray, about: str) -> None:
    """ModelError for what no body can have; J: about its centre of mass."""
    moments = np.linalg.eigvalsh(J)
    told = ", ".join(f"{one:.4g}" for one in moments)
    size = np.trace(J)
    point = (
        "; found after they were brought to the centre of mass: were they about it already, about='centre'?"
        if about == "frame"
        else ""
    )
    if moments[0] < SMALLEST * abs(size):
        raise ModelError(
            f"{place}: found principal moments of inertia {told} kg.m2, expected none below zero; see the signs of "
            f"products, and units{point}"
        )
    if moments[2] - moments[0] - moments[1] > ROUNDED * size:
        raise ModelError(
            f"{place}: found principal moments of inertia {told} kg.m2, expected none above the sum of the other two: no "
            "body has them; are products integrals of x y dm, products='integrals', or inertias about the origin of the "
            f"frame, about='frame'?{point}"
        )
    if np.sqrt(moments[2] / m) > FAR:
        raise ModelError(
            f"{place}: found a radius of gyration of {np.sqrt(moments[2] / m):.4g} m, expected at most {FAR:g} m; see the "
            "units of inertia, as in Jxx [kg.mm2], and of mass"
        )
