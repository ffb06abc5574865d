"""What the compiler cannot do with a model, in the words of the model: errors with what was found, expected and to do."""

from collections.abc import Iterable, Sequence

import numpy as np

from gantrytau.compiler.aliases import Reduced
from gantrytau.compiler.dulmage_mendelsohn import decompose
from gantrytau.errors import InitializationError, ModelError, StructureError
from gantrytau.flattening.flat_model import FlatModel
from gantrytau.language.statements import Equation
from gantrytau.language.symbols import split_derivative


def unbalanced(reduced: Reduced, signature: list[dict[int, int]], flat: FlatModel) -> StructureError:
    """Which unknowns stay undetermined, and which equations are too many."""
    found = decompose(signature, len(reduced.unknowns))
    n, m = (
        sum(len(v.elements) for v in flat.variables) - len(reduced.known),
        len(flat.equations) - len(reduced.redundant),
    )
    text = f"{flat.name}: {n} unknown{'' if n == 1 else 's'}, {m} equation{'' if m == 1 else 's'}."
    if found.free:
        text += _undetermined(
            [reduced.unknowns[j] for j in found.undetermined], len(found.free), reduced, flat
        )
    if found.surplus:
        text += _overdetermined(found.overdetermined, len(found.surplus), reduced, signature)
    return StructureError(text)


def _undetermined(unknowns: Sequence[str], count: int, reduced: Reduced, flat: FlatModel) -> str:
    """unknowns: of which any `count` may be free, inputs and those that say the likely cause being told first."""
    inputs = {reduced.aliases[n].root: n for n in flat.inputs if n not in reduced.known}
    names = sorted(unknowns, key=lambda n: (n not in inputs, n not in flat.hints, n.count(".")))
    first = inputs.get(names[0], names[0])
    hint = flat.hints.get(names[0])
    others = ", ".join(inputs.get(n, n) for n in names[1:6]) + (", ..." if len(names) > 6 else "")
    text = f" Undetermined: {first}" + (f" ({hint})" if hint else "")
    text += f"; {count} of it and {others} {'is' if count == 1 else 'are'} free" if others else ""
    if names[0] in inputs:
        return f"{text}. Name {first} among the given, or add {count} equation{'s' if count > 1 else ''}."
    where = first.rpartition(".")[0] or "the model"
    return (
        f"{text}. Add {count} equation{'s' if count > 1 else ''} for it in {where}, declare it an Input, or "
        "connect a component that determines it."
    )


def _overdetermined(
    rows: Sequence[int], count: int, reduced: Reduced, signature: list[dict[int, int]]
) -> str:
    lines = []
    for i in rows[:4]:
        found = "" if signature[i] else ", whose variables all follow from other equations"
        lines.append(f"{reduced.equations[i].name} `{reduced.equations[i].text[:80]}`{found}")
    more = f"; and {len(rows) - 4} others" if len(rows) > 4 else ""
    return (
        f" Overdetermined by {count}: these equations contradict or repeat each other: "
        f"{'; '.join(lines)}{more}. "
        "Remove one of them, or let one more variable be unknown."
    )


def undetermined(
    flat: FlatModel, reduced: Reduced, free: Sequence[str], equations: Iterable[str]
) -> StructureError:
    """Unknowns whose coefficients in some equations are zero."""
    hints = {
        (alias.root, alias.order): flat.hints[name]
        for name, alias in reduced.aliases.items()
        if name in flat.hints
    }
    words = []
    for name in free[:4]:
        base, order = split_derivative(name)
        hint = next((hints[base, k] for k in range(order, -1, -1) if (base, k) in hints), "")
        words.append(name + (f" ({hint})" if hint else ""))
    names = list(dict.fromkeys(equations))
    shown = "; ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
    return StructureError(
        f"{flat.name}: {', '.join(words)} {'is' if len(words) == 1 else 'are'} not determined at the start: the "
        f"coefficients in {shown} leave it free. Expected mass, inertia or a drive for every motion: give it one, hold "
        "the motion, or start from another pose"
    )


def without_inertia(flat: FlatModel, names: Sequence[str], equation: str) -> StructureError:
    """Coordinates that nothing accelerates."""
    words = ", ".join(f"{n} ({flat.hints[n]})" for n in names[:4])
    return StructureError(
        f"{flat.name}: {words} would have to follow from a balance of forces, {equation}, because this motion has "
        "neither mass nor inertia. Expected a mass or an inertia for every motion: put a Body there, or hold the motion"
    )


def no_state(title: str, name: str, states: Sequence[str]) -> StructureError:
    """A state that is asked for and cannot be one beside the others."""
    return StructureError(
        f"{title}: {name} cannot be a state together with the others asked for; the states of this model can be "
        f"{', '.join(states)} ({len(states)} in all). Name other variables in states=, or fewer",
        argument="states",
    )


def dependent(title: str, equations: Sequence[Equation], matrix: np.ndarray, least: float) -> StructureError:
    """Constraints whose Jacobian, a row each, has not their number as its rank; least: expected singular value."""
    left, values, _ = np.linalg.svd(matrix)
    weak = [i for i in np.argsort(-np.abs(left[:, -1]))[:4] if abs(left[i, -1]) > 0.1]
    names = "; ".join(f"{equations[i].name} `{equations[i].text[:80]}`" for i in sorted(weak))
    return StructureError(
        f"{title}: constraints depend on each other at the start (smallest singular value {values[-1]:.2g}, expected "
        f"above {least:g}): {names}. Start from another pose, or remove the constraint that repeats another"
    )


def overdriven(flat: FlatModel, inputs: Sequence[str], against: Sequence[str]) -> StructureError:
    """Constraints that hold only as long as the inputs happen to agree."""
    return StructureError(
        f"{flat.name}: more is driven than can move: with the inputs {', '.join(inputs)} given, {'; '.join(against)} "
        "can only hold if they agree by chance. Expected as many driven joints as the mechanism has freedoms: "
        "leave one drive out, or drive by a force"
    )


def differentiated(name: str, what: str, place: str) -> ModelError:
    """What jumps at instants and is differentiated somewhere."""
    return ModelError(
        f"{name} is {what} and jumps at instants, but {place} has it differentiated; pass it through a filter "
        "(gantrytau.mechanics.filters.LowPass), or let it drive a force instead of a motion"
    )


def open_loops(flat: FlatModel, error: InitializationError) -> InitializationError:
    """Which loops stay open and by how much, where the failure is one of closing."""
    words = []
    for loop in flat.loops:
        place = f"{loop.a} - {loop.b}, "
        gaps = {
            kind: np.linalg.norm([v for n, v in error.residuals.items() if n.startswith(place + kind)])
            for kind in ("position", "orientation")
        }
        # least squares leave a share of the gap in every part of the loop
        for member in loop.members:
            shares = [v for n, v in error.residuals.items() if n.startswith(f"{member} (")]
            gaps["position"] += np.linalg.norm(shares)
        if any(gaps.values()):
            # the residual of orientation is 2 tan(angle / 2)
            angle = np.degrees(2 * np.arctan(gaps["orientation"] / 2))
            words.append(
                f"the loop through {', '.join(loop.members)} stays open between {loop.a} and {loop.b}, by "
                f"{gaps['position']:.3g} m and {angle:.3g} deg"
            )
    if not words:
        return error
    return InitializationError(
        f"{flat.name}: {'; '.join(words)}. Expected frames that meet: correct lengths, offsets or joint axes, or, if it "
        "can be closed, give start values of its joints nearer to that",
        residuals=error.residuals,
    )
