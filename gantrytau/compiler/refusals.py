"""What the compiler cannot do with a model, in the words of the model: errors with what was found, expected and to do."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from gantrytau.border.refusal import InitializationError, StructureError
from gantrytau.compiler.aliases import Reduced, eliminate_aliases
from gantrytau.compiler.dulmage_mendelsohn import decompose, signature
from gantrytau.flattening.flat_model import FlatModel
from gantrytau.language.statements import Equation
from gantrytau.language.symbols import split_derivative

CLOSED = 1e-6  # m or rad by which a loop that can be closed may be missed, where the nearest place is sought
NEAR = 1e-6  # of a start, that is none to tell of
MOST_SUSPECTS = 12  # inputs that are tried as unknowns, where equations are too many


def unbalanced(reduced: Reduced, rows: list[dict[int, int]], flat: FlatModel) -> StructureError:
    """Which unknowns stay undetermined, and which equations are too many; rows: what `signature` says of them."""
    found = decompose(rows, len(reduced.unknowns))
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
        causes = "".join(f" {words}." for words in _causes(reduced, flat, len(found.surplus)))
        text += causes + _overdetermined(found.overdetermined, len(found.surplus), reduced, rows, not causes)
    return StructureError(text)


def _causes(reduced: Reduced, flat: FlatModel, surplus: int) -> list[str]:
    """What makes equations too many, in words: modifications, inputs and given names without which they are fewer."""
    inputs = set(flat.inputs)
    bound: dict[str, list[Equation]] = {}
    for equation in flat.equations:
        if equation.model == "binding" and flat.vectors[equation.path].kind != "input":
            bound.setdefault(equation.path, []).append(equation)
    found = []
    for name, equations in bound.items():
        if _helps(reduced, flat, without=equations):
            texts = np.array([str(e.right) for e in equations]).reshape(flat.vectors[name].shape, order="F")
            value = str(texts.tolist()).replace("'", "")
            own = name.rpartition(".")[2]
            found.append(
                f"{name} is set by the modification {own}={value}, which is an equation; a start value is "
                f"{own}=Start({value}), one that must hold {own}=Fixed({value})"
            )
    for name, equations in _setters(flat).items():
        if len(equations) > 1 and _helps(reduced, flat, without=equations[-1:]):
            places = " and by ".join(_quoted(e) for e in equations)
            found.append(f"{name}, an input, is driven more than once, by {places}; leave one out")
    discretes = set(flat.discretes)
    for equation in flat.equations:
        sides = {side.name() for side in (equation.left, equation.right) if side.is_symbolic()} & discretes
        if sides and _helps(reduced, flat, without=[equation]):
            found.append(
                f"{min(sides)}, a Discrete, counts as known, and {_quoted(equation)} seems to set it; only actions of when "
                "set a Discrete: move it there, or declare it a Real"
            )
    known = [n for n in reduced.known if n not in flat.event_names]
    given = [n for n in known if n not in inputs and _helps(reduced, flat, open=n)]
    if given:
        rest = surplus - len(given)
        more = f", and {rest} of the equations named below" if rest > 0 else ""
        found.append(f"More is given than can be chosen; leave out {' or '.join(sorted(given)[:6])}{more}")
    inner = [
        v.name
        for v in flat.variables
        if v.kind == "input" and v.owner and inputs & set(v.elements) & set(known)
    ]
    open_inputs = [n for n in inner[:MOST_SUSPECTS] if _helps(reduced, flat, open=n)]
    if open_inputs:
        several = len(open_inputs) > 1
        found.append(
            f"{', '.join(open_inputs[:6])} {'are open inputs and count' if several else 'is an open input and counts'} as "
            f"known from outside: to drive {'one' if several else 'it'} from here, write an equation with "
            f"{open_inputs[0]} alone on one side, in place of another"
        )
    return found


def _setters(flat: FlatModel) -> dict[str, list[Equation]]:
    """By input, the equations outside of its component that have it alone on one side."""
    owners = {n: v.owner for v in flat.variables if v.kind == "input" for n in v.elements}
    found: dict[str, list[Equation]] = {}
    for equation in flat.equations:
        for side in (equation.left,) if equation.model == "binding" else (equation.left, equation.right):
            name = side.name() if side.is_symbolic() else ""
            if name in owners and equation.path != owners[name]:
                found.setdefault(name, []).append(equation)
    return found


def _helps(reduced: Reduced, flat: FlatModel, without: Sequence[Equation] = (), open: str = "") -> bool:
    """Whether fewer equations are too many without some of them, or with something known as an unknown."""

    def surplus(model: FlatModel, known: frozenset[str]) -> int:
        other = eliminate_aliases(model, reduced.table, known)
        return len(decompose(signature(other.incidence, other.unknowns), len(other.unknowns)).surplus)

    left = replace(flat, equations=tuple(e for e in flat.equations if e not in without))
    opened = reduced.known - set(flat.expand(open)) if open else reduced.known
    return surplus(left, opened) < surplus(flat, reduced.known)


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
    for name, equations in _setters(flat).items():
        if reduced.aliases[name].root in unknowns:
            text += f". {name}, an input, counts as set by {_quoted(equations[0])}"
    return (
        f"{text}. Add {count} equation{'s' if count > 1 else ''} for it in {where}, declare it an Input, or "
        "connect a component that determines it."
    )


def _quoted(equation: Equation) -> str:
    """Where an equation stands, and what it says unless it is long."""
    text = equation.text
    return f"{equation.name} `{text if len(text) <= 80 else text[:77] + '...'}`"


def _overdetermined(
    rows: Sequence[int], count: int, reduced: Reduced, sides: list[dict[int, int]], remedy: bool
) -> str:
    lines = []
    for i in rows[:4]:
        found = "" if sides[i] else ", whose variables all follow from other equations"
        lines.append(_quoted(reduced.equations[i]) + found)
    more = f"; and {len(rows) - 4} others" if len(rows) > 4 else ""
    return (
        f" Overdetermined by {count}: these equations contradict or repeat each other: "
        f"{'; '.join(lines)}{more}."
        + (" Remove one of them, or let one more variable be unknown." if remedy else "")
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


def dependent(title: str, equations: Sequence[Equation], matrix: np.ndarray, least: float) -> StructureError:
    """Constraints whose Jacobian, a row each, has not their number as its rank; least: expected singular value."""
    left, values, _ = np.linalg.svd(matrix)
    weak = [i for i in np.argsort(-np.abs(left[:, -1]))[:4] if abs(left[i, -1]) > 0.1]
    names = "; ".join(_quoted(equations[i]) for i in sorted(weak))
    return StructureError(
        f"{title}: constraints depend on each other at the start (smallest singular value {values[-1]:.2g}, expected "
        f"above {least:g}): {names}. Start from another pose, or remove the constraint that repeats another"
    )


def held_together(title: str, names: Sequence[str], why: str) -> StructureError:
    """Equations that hold the same combination of unknowns, the highest derivatives of variables."""
    shown = " and ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
    return StructureError(
        f"{title}: {shown} hold their highest derivatives in the same combination, and {why}. Expected equations from which "
        "each of these follows: write one of them without these, or replace the one that repeats the others"
    )


def open_loops(
    flat: FlatModel, error: InitializationError, nearest: Mapping[str, float], starts: str
) -> InitializationError:
    """Which loops stay open and by how much, where the failure is one of closing.

    nearest: what is left of the closing equations, by name, where the loops are nearest to closed; starts: words on fixed
    ones with which they close.
    """
    words = []
    for loop in flat.loops:
        place = f"{loop.a} - {loop.b}, "
        gaps = {
            kind: np.linalg.norm([v for n, v in nearest.items() if n.startswith(place + kind)])
            for kind in ("position", "orientation")
        }
        if any(gap > CLOSED for gap in gaps.values()):
            # the residual of orientation is 2 tan(angle / 2)
            angle = np.degrees(2 * np.arctan(gaps["orientation"] / 2))
            words.append(
                f"the loop through {', '.join(loop.members)} stays open between {loop.a} and {loop.b}, by "
                f"{gaps['position']:.3g} m and {angle if angle > 0.01 else 0:.3g} deg"
            )
    if not words:
        return InitializationError(
            f"{flat.name}: the loops can be closed, but no way leads there from the start values; give start values of the "
            f"joints nearer to a pose that is closed. {error}",
            residuals=error.residuals,
        )
    return InitializationError(
        f"{flat.name}: {'; '.join(words)}. Expected frames that meet: correct lengths, offsets or joint axes, or, if it "
        f"can be closed, give start values of its joints nearer to that{starts}",
        residuals=error.residuals,
    )


def more_held(title: str, fixed: Sequence[str], driven: Mapping[str, str], mobility: int) -> StructureError:
    """Fixed starts and driven joints, by the equations that drive, which are more than loops leave free."""
    parts = []
    if fixed:
        parts.append(f"{len(fixed)} fixed starts, of {', '.join(fixed)}")
    if driven:
        joints = ", ".join(f"{joint} by {equation}" for equation, joint in driven.items())
        parts.append(f"{len(driven)} driven joints, {joints}")
    ways = ["fix fewer, with Start(...) for the others"] if fixed else []
    ways += ["leave one drive out, or drive by a force"] if driven else []
    return StructureError(
        f"{title}: found {' and '.join(parts)}, where loops leave mobility {mobility} to these. Expected at most "
        f"{mobility}, or values that agree: {'; '.join(ways)}"
    )


def nearest_words(starts: Mapping[str, tuple[float, float]]) -> str:
    """Consistent values near fixed starts, as the end of a message; "" where none has to move."""
    moved = [
        f"{n} = {near:.6g} in place of {value:.6g}"
        for n, (value, near) in starts.items()
        if abs(near - value) > NEAR * max(1.0, abs(value))
    ]
    return f"; consistent near these starts: {', '.join(moved)}" if moved else ""
