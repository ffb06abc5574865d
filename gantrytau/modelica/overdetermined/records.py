"""Records of connectors that have a function `equalityConstraint`, as the orientation of a frame."""

from collections.abc import Iterator
from typing import Any, cast

import casadi as ca

from gantrytau.border.refusal import ModelError
from gantrytau.language.declarations import Propagated
from gantrytau.language.symbols import der

ORIENTATION = "Modelica.Mechanics.MultiBody.Frames.Orientation"
DRAWN = tuple(f"Modelica.Mechanics.MultiBody.Visualizers.{name}." for name in ("Advanced", "Internal"))


def is_propagated(structure: Any) -> bool:
    """Whether an instance is a record of a connector that is passed on along the spanning tree."""
    around = structure.around
    inside = around is not None and around.scope.definition.kind == "connector"
    return inside and is_overdetermined(structure)


def is_connector(structure: Any) -> bool:
    """Whether an instance is a connector, or a record in one that is connected member by member."""
    around, kind = structure.around, structure.scope.definition.kind
    inside = kind == "record" and around is not None and is_connector(around)
    return kind == "connector" or (inside and not is_overdetermined(structure))


def is_overdetermined(structure: Any) -> bool:
    """Whether an instance is a record with a function `equalityConstraint`."""
    scope = structure.scope
    return scope.definition.kind == "record" and scope.inherited_class("equalityConstraint") is not None


def is_drawn(scope: Any) -> bool:
    """Whether a class is a shape of an animation, without connectors, on which nothing depends."""
    return scope.name.startswith(DRAWN)


def propagated_quantity(name: str, structure: Any, shape: Any, words: dict[str, Any]) -> Propagated:
    """The declaration of a member of such a record."""
    rate = _rotated if name == "T" and structure.scope.name == ORIENTATION else None
    return Propagated(shape, rate=rate, **{k: v for k, v in words.items() if k in ("unit", "description")})


def _rotated(R: Any) -> Any:
    """Time derivative of the matrix of an Orientation, which turns from the world to the frame."""
    return -ca.skew(R.w) @ R.T


def closing(a: Any, b: Any, residual_of: Any) -> Iterator[tuple[str, str, Any, Any, Any]]:
    """Residuals of a connection that closes a loop: equal potentials, and an `equalityConstraint` that vanishes.

    Flows enforce them, in the order of declaration. Beside an Orientation potentials are positions in the world, and flows
    are resolved in the frame. residual_of: the value of `equalityConstraint` of two records.
    """
    members = type(a).members()
    flows = iter([name for name, one in members.items() if getattr(one, "kind", "") == "flow"])
    turned = next((one.T for one in vars(a).values() if _is_orientation(one)), None)
    for name, member in members.items():
        one, other = cast(Any, getattr(a, name, None)), cast(Any, getattr(b, name, None))
        if getattr(member, "kind", "") == "real":
            gap = one - other
            turn = ca.SX.eye(gap.numel()) if turned is None else turned
            found = "position", turn @ gap, turn @ der(gap)
        elif (structure := getattr(type(one), "structure", None)) and is_propagated(structure):
            residual = ca.SX(residual_of(structure, one, other))
            if not residual.numel():
                continue
            found = "orientation", residual, other.w - one.w if _is_orientation(one) else der(residual)
        else:
            continue
        words, residual, rate = found
        flow = next(flows, None)
        if flow is None or getattr(a, flow).numel() != residual.numel():
            raise ModelError(
                f"found a loop of {type(a).__name__} with {residual.numel()} residuals of '{name}' and no flow of as many "
                "elements, expected a flow beside each potential and each overdetermined record"
            )
        yield words, flow, ca.SX.eye(residual.numel()), residual, rate


def _is_orientation(record: Any) -> bool:
    structure = getattr(type(record), "structure", None)
    return structure is not None and structure.scope.name == ORIENTATION
