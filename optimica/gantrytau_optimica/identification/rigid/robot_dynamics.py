"""Forces of a robot as a function of its motion and of some parameters, with slopes, from the model's own equations.

    f = y(q, q', q''; p)          rows y (n,) in N or N.m, slopes dy/dp (n, k), exact

The model is asked for its forces given its driven coordinates, whatever loops it has: what has no closed form is solved
inside, row by row. Where y is linear in p, slopes are the same at any p, which is looked at and not assumed.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np

from gantrytau import GantryTauError, ModelError
from gantrytau.border.refusal import did_you_mean
from gantrytau.dae import Dae
from gantrytau.flattening.flat_model import FlatParameter
from gantrytau_optimica.identification.rigid.body_parameters import BodyParameters
from gantrytau_optimica.identification.rigid.vectorised_regressor import (
    LEAST,
    MOST,
    of_columns,
    takes_columns,
)

BLOCK = 1024  # rows of one call, as many as caches hold
PUBLIC = {"cart_masses": "carts[{}].m", "link_masses": "arms[{}].link_mass"}  # words of the robots' records
PLATE = ("plate_mass", "tool.m", "platform.m")  # what a robot calls its plate
LAWS = re.compile(r"(?:^|\.)(f_c|f_v|f_s)(\[\d\])?$")  # as all laws of friction name their parameters
LINEAR = 1e-9  # of the largest slope of a parameter, by which rounding may change it


class IdentificationError(GantryTauError):
    """Motion and forces that do not determine the parameters of a robot, or are not its own."""


@dataclass(frozen=True, eq=False)
class RobotDynamics:
    """Inverse dynamics of a robot in some of its parameters.

    coordinates, forces: scalar names, n each; names: public names of the parameters, k; values: by model name, of what
    is set besides: frictions that are identified apart are zero, fixed parameters what they are fixed to.
    """

    dae: Dae
    coordinates: tuple[str, ...]
    forces: tuple[str, ...]
    names: tuple[str, ...]
    values: Mapping[str, float]

    @cached_property
    def bodies(self) -> tuple[BodyParameters, ...]:
        """Bodies of which all ten parameters are asked, or all but the mass."""
        return tuple(body for body in bodies_of(self.dae) if body.names[1] in self.names)

    @cached_property
    def _own(self) -> dict[str, float]:
        """Numbers of all parameters, by model name and, those of bodies, by public one."""
        found = {**self.dae.parameter_values, **self.values}
        for body in self.bodies:
            found |= dict(zip(body.names, body.of_model(found).tolist(), strict=True))
        return found

    @property
    def nominal(self) -> np.ndarray:
        """Values of the parameters in the model, (k,)."""
        return np.array([self._own[model_name(self.dae, n)] for n in self.names])

    def in_model(self, p: Sequence[Any]) -> dict[str, Any]:
        """Values of the model for parameters p, by model name; numbers or expressions, as p is."""
        asked = dict(zip(self.names, p, strict=True))
        found: dict[str, Any] = {}
        for body in self.bodies:
            found |= body.in_model([asked.get(n, self._own[n]) for n in body.names])
        of_bodies = {n for body in self.bodies for n in body.names}
        return found | {model_name(self.dae, n): x for n, x in asked.items() if n not in of_bodies}

    def ten(self, body: BodyParameters, p: np.ndarray) -> np.ndarray:
        """The ten parameters of a body where those of the robot are p."""
        asked = dict(zip(self.names, p, strict=True))
        return np.array([asked.get(n, self._own[n]) for n in body.names])

    @property
    def least(self) -> np.ndarray:
        """Lower limits that the model declares for the parameters, (k,)."""
        found = []
        for name in self.names:
            declared = self.dae.flat.find(model_name(self.dae, name))
            limit = None if declared is None else declared.min
            found.append(-np.inf if limit is None else self.dae.number(limit[0]))
        return np.array(found)

    @property
    def laws(self) -> tuple[str | None, ...]:
        """The component of symmetric friction beside each force, such as `carts[0].law`, None where there is none."""
        found = []
        for force in self.forces:
            owner = "".join(force.rpartition(".")[:2])
            within = [n for n in frictions(self.dae) if n.startswith(owner) and n.endswith(".f_c")]
            found.append(within[0].removesuffix(".f_c") if len(within) == 1 else None)
        return tuple(found)

    @cached_property
    def _function(self) -> ca.Function:
        settings = sorted({*self.values, *self.in_model(self.nominal.tolist())})
        whole = _inverse_dynamics(self.dae, self.coordinates, self.forces, tuple(settings))
        kind = ca.SX if whole.is_a("SXFunction") else ca.MX
        x, p = kind.sym("x", 3 * len(self.coordinates)), kind.sym("p", len(self.names))
        given = {**self.values, **self.in_model(ca.vertsplit(p))}
        y = ca.vertcat(*whole.call([*ca.vertsplit(x), *(kind(given[n]) for n in settings)]))
        slopes = ca.densify(ca.jacobian(y, p))
        return ca.Function("y", [x, p], [slopes, ca.densify(y)], {"cse": True})

    @cached_property
    def _takes_columns(self) -> bool:
        return takes_columns(self._function)

    def slopes(self, motion: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Slopes (N, n, k) and forces (N, n) of rows (N, 3 n) of q, q', q''; NaN where the model has no answer."""
        n, k, rows = len(self.coordinates), len(self.names), len(motion)
        A, y = np.empty((rows, k, n)), np.empty((rows, n))
        x, p = np.ascontiguousarray(motion, dtype=float), np.asarray(p, dtype=float)
        many = rows >= LEAST and self._takes_columns
        for block in np.array_split(np.arange(rows), max(1, -(-rows // (MOST if many else BLOCK)))):
            part = slice(block[0], block[-1] + 1) if len(block) else slice(0, 0)
            (self._by_columns if many else self._by_rows)(x[part], p, A[part], y[part])
        return A.transpose(0, 2, 1), y

    def _by_rows(self, x: np.ndarray, p: np.ndarray, A: np.ndarray, y: np.ndarray) -> None:
        # read and written where they stand
        buffer, evaluate = self._function.map(len(x)).buffer()
        for i, given in enumerate((x, np.tile(p, (len(x), 1)))):
            buffer.set_arg(i, given.data)
        for i, found in enumerate((A, y)):
            buffer.set_res(i, found.data)
        evaluate()

    def _by_columns(self, x: np.ndarray, p: np.ndarray, A: np.ndarray, y: np.ndarray) -> None:
        slopes, forces = of_columns(self._function, np.ascontiguousarray(x.T), p)
        for j, column in enumerate(slopes):
            A[:, j // y.shape[1], j % y.shape[1]] = column
        for i, column in enumerate(forces):
            y[:, i] = column

    def not_linear(self, motion: np.ndarray) -> tuple[str, ...]:
        """Parameters along which slopes change, at these rows: forces are not linear in them."""
        begin = self.nominal
        first, _ = self.slopes(motion, begin)
        sizes = np.nanmax(np.abs(first), axis=(0, 1), initial=0.0)
        away = 1.5 * begin + 0.5  # from zero, where a product would hide

        def bends(p: np.ndarray) -> bool:
            changed = np.nanmax(np.abs(self.slopes(motion, p)[0] - first), axis=(0, 1), initial=0.0)
            return bool(np.any(changed > LINEAR * np.maximum(sizes, 1e-3 * np.max(sizes, initial=0.0))))

        if not bends(away):
            return ()
        single = np.where(np.eye(len(begin), dtype=bool), away, begin)
        return tuple(name for name, p in zip(self.names, single, strict=True) if bends(p))


@lru_cache(maxsize=8)  # models of one robot differ in what is known, not in this
def _inverse_dynamics(
    dae: Dae, q: tuple[str, ...], forces: tuple[str, ...], settings: tuple[str, ...]
) -> ca.Function:
    """Forces of q, q', q'' and of the parameters in `settings`, all scalars."""
    motion = [*q, *(f"der({n})" for n in q), *(f"der(der({n}))" for n in q)]
    whole = dae.function(given=[*motion, *settings], find=list(forces))
    try:
        return whole.expand()
    except RuntimeError:  # loops without closed form are solved by a call, which has no written form
        return whole


def model_name(dae: Dae, name: str) -> str:
    """Name in the model of a parameter with a public name such as `cart_masses[0]`; others keep their own."""
    if name == "plate_mass":
        return next((n for n in PLATE if n in dae.adjustable), name)
    parted = re.fullmatch(r"(\w+)\[(\d+)\]", name)
    return PUBLIC[parted[1]].format(parted[2]) if parted and parted[1] in PUBLIC else name


def public_name(name: str) -> str:
    """The other way round."""
    if name in PLATE:
        return "plate_mass"
    for word, pattern in PUBLIC.items():
        parted = re.fullmatch(re.escape(pattern).replace(r"\{\}", r"(\d+)"), name)
        if parted:
            return f"{word}[{parted[1]}]"
    return name


def drives(dae: Dae) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Driven coordinates and what drives them: the `s` or `phi` beside each input force or torque."""
    coordinates = []
    for force in dae.inputs:
        owner = "".join(force.rpartition(".")[:2])  # with its dot; the model itself has none
        beside = [f"{owner}{n}" for n in ("s", "phi")]
        found = next((n for n in beside if n in dae.variables), None)
        if found is None:
            raise ModelError(
                f"identify: {dae.name} has no {' or '.join(beside)} beside its input {force}, expected the coordinate that "
                "it drives; give the component one"
            )
        coordinates.append(found)
    if not coordinates:
        raise ModelError(
            f"identify: {dae.name} has no inputs, expected forces or torques; declare them as Input"
        )
    return tuple(coordinates), tuple(dae.inputs)


def candidates(dae: Dae) -> tuple[str, ...]:
    """Public names of the masses and moments of inertia of a robot that can be adjusted; frictions stand elsewhere."""
    found = []
    for name in dae.adjustable:
        declared = dae.flat.find(name)
        if declared is None or declared.shape != ():
            continue
        if declared.unit in ("kg", "kg.m2") and not LAWS.search(name):
            found.append(public_name(name))
    return tuple(dict.fromkeys(found))


def bodies_of(dae: Dae) -> tuple[BodyParameters, ...]:
    """Bodies of a robot whose mass, centre of mass and inertia can all be adjusted."""
    found, adjustable = [], set(dae.adjustable)
    for path in (n.removesuffix(".r_cm[0]") for n in dae.adjustable if n.endswith(".r_cm[0]")):
        element, declared = f"{path}.m", dae.flat.find(f"{path}.m")
        if element not in adjustable and isinstance(declared, FlatParameter) and declared.value:
            element = str(declared.value[0])  # where the mass is that of a parameter of the robot
        body = BodyParameters(path, public_name(element), element)
        if adjustable.issuperset(body.elements):
            found.append(body)
    return tuple(found)


def frictions(dae: Dae) -> tuple[str, ...]:
    """Names of the parameters of friction in the model."""
    return tuple(n for n in dae.adjustable if LAWS.search(n))


def expanded(names: Iterable[str] | str, known: Sequence[str]) -> tuple[str, ...]:
    """Scalar names; a family such as `link_masses` stands for all of it. ModelError for names that are not known."""
    found: list[str] = []
    for name in (names,) if isinstance(names, str) else tuple(names):
        members = [n for n in known if n == name or n.startswith(f"{name}[")]
        if not members:
            raise ModelError(f"identify: there is no parameter {name!r}{did_you_mean(name, known)}")
        found += members
    return tuple(dict.fromkeys(found))
