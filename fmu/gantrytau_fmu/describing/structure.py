"""The model structure as both versions list it: who depends on whom, during simulation and at its start.

FMI 3.0.2, section 2.4.8; FMI 2.0.4, section 2.2.8. What is not known about dependencies is left out, which means
"on everything"; a wrong list would let an importer break algebraic loops that are there.
"""

from collections.abc import Collection
from dataclasses import dataclass

from gantrytau.errors import ModelError
from gantrytau_fmu.describing.interface_checks import initial_of
from gantrytau_fmu.description import Interface, Unknown


@dataclass(frozen=True)
class Row:
    """One entry; dependencies: None if it may depend on all knowns; kinds: None if all are "dependent"."""

    reference: int
    dependencies: tuple[int, ...] | None = None
    kinds: tuple[str, ...] | None = None


@dataclass(frozen=True)
class Structure:
    """The lists of the model structure; states: their references in the order of the derivatives."""

    outputs: tuple[Row, ...]
    derivatives: tuple[Row, ...]
    initial_unknowns: tuple[Row, ...]
    states: tuple[int, ...]


def structure(interface: Interface, fmi: str) -> Structure:
    """The structure of a checked interface. Raises ModelError for a dependency on what can be no known.

    In FMI 2 the knowns are inputs, states and time; parameters and held values are known too in FMI 3.
    """
    variables = interface.variables
    states = tuple(
        place for u in interface.derivatives if (place := variables[u.reference].derivative) is not None
    )
    knowns = {v.reference for v in variables if v.causality in ("input", "independent")}.union(states)
    frozen = {
        v.reference for v in variables if v.causality == "parameter" or v.variability != "continuous"
    } - knowns
    told = knowns | frozen if fmi == "3.0" else knowns

    def rows(unknowns: tuple[Unknown, ...]) -> tuple[Row, ...]:
        for unknown in unknowns:
            for place in unknown.dependencies:
                if place not in knowns and place not in frozen:
                    raise ModelError(
                        f"{interface.name}: '{variables[unknown.reference].name}' depends on '{variables[place].name}', "
                        "which is no input, state, parameter or time; list those that it stems from"
                    )
        return tuple(_row(interface, unknown, told) for unknown in unknowns)

    return Structure(
        rows(interface.outputs), rows(interface.derivatives), initial_rows(interface, fmi, states), states
    )


def initial_rows(interface: Interface, fmi: str, states: tuple[int, ...]) -> tuple[Row, ...]:
    """Outputs, states and derivatives that are calculated at the start, in the order of their references.

    Their dependencies are those of `interface.initial_unknowns`, where it lists them by what is known then: inputs,
    time, and what starts exactly. Otherwise they may depend on all of these, which FMI 3 writes out: CasADi 3.8
    does not read its entries without a list.
    """
    variables = interface.variables
    wanted = {v.reference for v in variables if v.causality == "output"}.union(states)
    wanted.update(unknown.reference for unknown in interface.derivatives)
    knowns = {v.reference for v in variables if v.causality == "independent" or initial_of(v) == "exact"}
    everything = tuple(sorted(knowns)) if fmi == "3.0" else None
    listed = {unknown.reference: unknown for unknown in interface.initial_unknowns}
    found = []
    for place in sorted(wanted):
        if initial_of(variables[place]) not in ("approx", "calculated"):
            continue
        unknown = listed.get(place)
        if unknown is None or not knowns.issuperset(unknown.dependencies):
            found.append(Row(place, everything))
        else:
            found.append(_row(interface, unknown, knowns, kinds=("constant",)))
    return tuple(found)


def _row(
    interface: Interface,
    unknown: Unknown,
    told: Collection[int],
    kinds: tuple[str, ...] = ("constant", "fixed", "tunable", "discrete"),
) -> Row:
    """Dependencies on what is told, ascending; only kinds that may stand there, and only for real unknowns."""
    real = interface.variables[unknown.reference].type == "real"
    pairs = sorted(
        (place, kind if real and kind in kinds else "dependent")
        for place, kind in zip(unknown.dependencies, unknown.kinds, strict=True)
        if place in told
    )
    places = tuple(place for place, _ in pairs)
    how = tuple(kind for _, kind in pairs)
    return Row(unknown.reference, places, how if set(how) - {"dependent"} else None)
