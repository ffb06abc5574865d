"""The model structure as both versions list it: who depends on whom, during simulation and at its start.

FMI 3.0.2, section 2.4.8; FMI 2.0.4, section 2.2.8. What is not known about dependencies is left out, which means
"on everything"; a wrong list would let an importer break algebraic loops that are there.
"""

from collections.abc import Collection, Set
from dataclasses import replace

from gantrytau.border.refusal import ModelError
from gantrytau_fmu.describing.description_checks import initial_of
from gantrytau_fmu.description import FmuDescription, ModelStructure, Unknown

KINDS = ("constant", "fixed", "tunable", "discrete")


def written_structure(fmu: FmuDescription) -> ModelStructure:
    """The lists of a checked description as its version writes them. Raises ModelError for what can be no known.

    In FMI 2 the knowns are inputs, states and time; parameters and held values are known too in FMI 3.
    """
    variables, states = fmu.variables, fmu.states
    knowns = {v.name for v in variables if v.causality in ("input", "independent")}.union(states)
    frozen = {
        v.name for v in variables if v.causality == "parameter" or v.variability != "continuous"
    } - knowns
    told = knowns | frozen if fmu.fmi == "3.0" else knowns
    lists = fmu.structure
    for unknown in (*lists.outputs, *lists.derivatives):
        for name in unknown.dependencies or ():
            if name not in knowns and name not in frozen:
                raise ModelError(
                    f"{fmu.name}: '{unknown.name}' depends on '{name}', "
                    "which is no input, state, parameter or time; list those that it stems from"
                )
    return replace(
        lists,
        outputs=tuple(_limited(fmu, unknown, told) for unknown in lists.outputs),
        derivatives=tuple(_limited(fmu, unknown, told) for unknown in lists.derivatives),
        initial_unknowns=_initial(fmu, states),
    )


def _initial(fmu: FmuDescription, states: Collection[str]) -> tuple[Unknown, ...]:
    """Outputs, states and derivatives that are calculated at the start, in the order of their references.

    Their dependencies are those of `initial_unknowns`, where it lists them by what is known then: inputs, time, and
    what starts exactly. Otherwise they may depend on all of these, which FMI 3 writes out: CasADi 3.8 does not read
    its entries without a list.
    """
    wanted = {*fmu.outputs, *states, *(unknown.name for unknown in fmu.structure.derivatives)}
    first = [v.name for v in fmu.variables if v.causality == "independent" or initial_of(v) == "exact"]
    everything, knowns = tuple(first) if fmu.fmi == "3.0" else None, frozenset(first)
    listed = {unknown.name: unknown for unknown in fmu.structure.initial_unknowns}
    found = []
    for variable in fmu.variables:
        if variable.name not in wanted or initial_of(variable) not in ("approx", "calculated"):
            continue
        unknown = listed.get(variable.name)
        if unknown is None or unknown.dependencies is None or not knowns.issuperset(unknown.dependencies):
            found.append(Unknown(variable.name, everything))
        else:
            found.append(_limited(fmu, unknown, knowns, kinds=("constant",)))
    return tuple(found)


def _limited(
    fmu: FmuDescription, unknown: Unknown, told: Set[str], kinds: tuple[str, ...] = KINDS
) -> Unknown:
    """Dependencies on what is told, ascending; only kinds that may stand there, and only for real unknowns."""
    if unknown.dependencies is None:
        return unknown
    real = fmu.by_name[unknown.name].real
    ways = unknown.kinds or ("dependent",) * len(unknown.dependencies)
    pairs = sorted(
        (fmu.by_name[name].reference, name, kind if real and kind in kinds else "dependent")
        for name, kind in zip(unknown.dependencies, ways, strict=True)
        if name in told
    )
    how = tuple(kind for _, _, kind in pairs)
    return Unknown(
        unknown.name, tuple(name for _, name, _ in pairs), how if set(how) - {"dependent"} else None
    )
