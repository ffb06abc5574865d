"""Masses, centres and inertias of bodies from a CSV file, as programs for design write them."""

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeVar

import numpy as np

from gantrytau.border.columns import Columns
from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.describing.record import Record
from gantrytau.language.model import Declared
from gantrytau.language.settings import with_setting

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
    table = Columns.read(path, "a line for each body")
    bodies: dict[str, dict[str, Any]] = {}
    numbers = _numbers(table)
    for k, (line, name) in enumerate(zip(table.lines, table.texts(_one(table, NAME)), strict=True)):
        place = f"{path}: line {line}"
        if not name:
            raise ModelError(f"{place}: found no name, expected that of a body, as carts[0].body")
        if name in bodies:
            raise ModelError(f"{place}: found '{name}' a second time, expected each body once")
        bodies[name] = _body(f"{place}: {name}", numbers[k], about, products)
    return Inertias(bodies, str(path))


def _choice(name: str, value: Any, known: tuple[str, ...]) -> None:
    if value not in known:
        raise ModelError(
            f"read_inertias: found {name}={value!r}, expected {' or '.join(map(repr, known))}", argument=name
        )


def _numbers(table: Columns) -> np.ndarray:
    """Mass, centre, moments and products of inertia of each body in SI, (n, 10), zeros for columns that are all missing."""
    mass = [_one(table, MASS)]
    centre, products = (_all_or_none(table, names) for names in (CENTRE, tuple(PRODUCTS.values())))
    diagonal = [_one(table, names) for names in DIAGONAL]
    for names in (centre, [*diagonal, *products]):
        _check_units(table, names)
    columns = [(mass, "kg"), (centre or [""] * 3, "m"), (diagonal, "kg.m2"), (products or [""] * 3, "kg.m2")]
    zeros = np.zeros(len(table))
    return np.column_stack(
        [
            table.column(name, unit, filled=True) if name else zeros
            for names, unit in columns
            for name in names
        ]
    )


def _named(table: Columns, names: tuple[str, ...]) -> str:
    """A column by one of its names, in any letters, empty for none; ModelError for two."""
    wanted = {name.lower() for name in names}
    found = [name for name in table.names if name.replace(" ", "").lower() in wanted]
    if len(found) > 1:
        raise ModelError(
            f"{table.path}: found the columns {' and '.join(found)}, expected one of them; delete the other"
        )
    return found[0] if found else ""


def _one(table: Columns, names: tuple[str, ...]) -> str:
    if not (found := _named(table, names)):
        raise ModelError(
            f"{table.path}: found no column {names[0]}, expected {EXAMPLE}{did_you_mean(names[0], table.names)}"
        )
    return found


def _all_or_none(table: Columns, names: tuple[tuple[str, ...], ...]) -> list[str]:
    found = [_named(table, each) for each in names]
    if any(found) and not all(found):
        lost = ", ".join(each[0] for each, name in zip(names, found, strict=True) if not name)
        raise ModelError(
            f"{table.path}: found no column {lost}, expected {', '.join(each[0] for each in names)}, all or none"
        )
    return found if all(found) else []


def _check_units(table: Columns, names: list[str]) -> None:
    """ModelError for columns of one kind of which some have a unit: nobody means a y in m beside an x in mm."""
    told = next((name for name in names if table.unit(name)), None)
    bare = [name for name in names if not table.unit(name)]
    if told and bare:
        unit = table.unit(told)
        raise ModelError(
            f"{table.path}: found {told} in {unit} and {', '.join(bare)} without a unit, expected units of all of them or "
            f"of none; write '{bare[0]} [{unit}]'"
        )


def _body(place: str, numbers: np.ndarray, about: str, products: str) -> dict[str, Any]:
    """The modifications of a Body. place: for messages; numbers: (10,) as in `_numbers`; others as of `read_inertias`."""
    m, r, J = float(numbers[0]), numbers[1:4], np.diag(numbers[4:7])
    for (i, k), value in zip(PRODUCTS, numbers[7:], strict=True):
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
