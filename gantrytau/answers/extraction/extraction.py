"""The equations of a mechanism between its tool T, its joints q and their forces f, cut out of the model.

The model is translated in the causality of its inverse dynamics: the motion of the tool is known. Then more is made
known, stratum by stratum, the blocks that follow are solved, and what is left over are the equations.

| known | found | Dressler (2012) |
|---|---|---|
| T, q | constraints g(T, q) = 0, left over | 6.3 |
| T, q, T' | speeds q' = J^-1 T' | 6.5 |
| T, q, T', q', q'' | accelerations T'' | 6.6 |
| all, f too | balance R = S1 T'' + S2 q'' + S0(T, q, T', q') - S f = 0, left over | 6.7 |

The forces inside are found from the equations nearest to f, so what is left over is the balance of the tool. Virtual
work makes it unique: with K S = J^-T, M1 = K S1, M2 = K S2, G = K S0 at rest, and the bias K S0 - G. Passive joints,
such as those that let a plate turn, are found from T and q; their rates count as following the tool.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.answers.extraction.cuts import EVERYTHING, FOLLOWS, Cut, Strata
from gantrytau.border.refusal import ModelError, StructureError
from gantrytau.compiler.request import Request, names
from gantrytau.compiler.translated import Translated
from gantrytau.compiler.translation import translate_flat, translate_model
from gantrytau.describing.record import Record
from gantrytau.flattening.flat_checks import refuse_events
from gantrytau.language.model import Model
from gantrytau.language.symbols import derivative_name
from gantrytau.writing.collect import collected, moving_part, without_factor
from gantrytau.writing.graph import Graph
from gantrytau.writing.subexpressions import Text, written
from gantrytau.writing.text import PlainSyntax

SAME = 1e-9  # relative difference below which numbers at all sample points count as one constant
POINTS, SPREAD = 12, 0.1  # sample points around the start, and how far, relative or in SI
LEAST = 1e-10  # of the largest singular value, below which a matrix is singular
Sections = tuple[tuple[str, tuple[str, ...]], ...]


@dataclass(frozen=True, eq=False)
class Mechanism(Record):
    """M1 T'' + M2 q'' + G + bias = J^-T f, with constraints g(T, q) = 0 and q' = J^-1 T'; prints itself.

    tool, joints, forces: scalar names, n each, in the order of T, q and f. The functions are CasADi's, vectors (n,), SI:
    constraints(T, q) -> g (n,); velocity_jacobian(T, q) -> J^-1 (n, n); accelerations(T, q, T', q', q'') -> T'';
    M1(T, q), M2(T, q) -> (n, n); G(T, q) -> (n,), gravity and other forces of position; bias(T, q, T', q') -> (n,),
    friction and products of velocities. M1 has the masses moving with T, M2 those moving with q,
    and both have a share of a body between them. All functions expect positions that satisfy the constraints.
    """

    model: str
    tool: tuple[str, ...]
    joints: tuple[str, ...]
    forces: tuple[str, ...]
    constraints: ca.Function
    velocity_jacobian: ca.Function
    accelerations: ca.Function
    M1: ca.Function
    M2: ca.Function
    G: ca.Function
    bias: ca.Function
    written: Sections = field(repr=False)

    def equations(self) -> str:
        """The four systems of equations in the names of the model, parameters included."""
        lines = [f"{self.model}"]
        lines += [f"{role}: {', '.join(getattr(self, attribute))}" for role, attribute in ROLES.items()]
        for title, rows in self.written:
            lines += ["", title, *(f"  {row}" for row in rows)] if rows else []
        return "\n".join(lines) + "\n"

    def __str__(self) -> str:
        return self.equations()


ROLES = {"T": "tool", "q": "joints", "f": "forces"}
ARGUMENTS = {
    "constraints": ("T", "q"),
    "velocity_jacobian": ("T", "q"),
    "accelerations": ("T", "q", "dT", "dq", "ddq"),
    "M1": ("T", "q"),
    "M2": ("T", "q"),
    "G": ("T", "q"),
    "bias": ("T", "q", "dT", "dq"),
}


RELATIONS = ("constraints", "accelerations")  # written as 0 = ...
TITLES = {
    "constraints": "constraints of tool and joints (6.3)",
    "velocity_jacobian": "speeds: q' = J^-1 T' (6.5)",
    "accelerations": "accelerations: 0 = D' (T'' - q'' e) + c, to be solved for T'' (6.6)",
    "M1": "balance of forces: M1 T'' + M2 q'' + G + bias = J^-T f (6.7)",
    "M2": "inertia that moves with the joints",
    "G": "gravity and other forces of position",
    "bias": "friction and products of velocities",
}


def extract_mechanism(
    model: Model | Translated, *, tool: str | Sequence[str], joints: Sequence[str], forces: Sequence[str]
) -> Mechanism:
    """The equations of a mechanism as named functions, extracted from the model.

    tool: names of the tool's coordinates, such as "tool.r"; joints: coordinates of the driven joints; forces: driving force
    of each joint. Each list has as many scalars as the mechanism has degrees of freedom. Other inputs keep their start
    values. Source: Dressler (2012), section 6.3. Raises ModelError for unknown names and counts that do not fit,
    StructureError where tool, joints and forces do not determine each other.
    """
    dae = model if isinstance(model, Translated) else translate_model(model)
    refuse_events(dae.flat)
    roles = _roles(dae, {"T": tool, "q": joints, "f": forces})
    strata = Strata(_moved_by_tool(dae, roles), roles)
    pieces = _pieces(strata)
    functions = _functions(strata, pieces, by_value=True)
    closed = _functions(strata, pieces, by_value=False)
    weights = _weights(strata, closed)
    kind = ca.SX if _written_out(functions) else ca.MX
    arguments = {k: kind.sym(k, len(strata.names(k))) for k in EVERYTHING}
    systems = _systems(functions, {**arguments, "p": strata.numbers}, weights)
    found = {
        name: ca.Function(
            name, [arguments[k] for k in kinds], [systems[name]], list(kinds), [name.lower()], {"cse": True}
        )
        for name, kinds in ARGUMENTS.items()
    }
    lists = {ROLES[k]: v for k, v in roles.items()}
    return Mechanism(model=dae.name, **lists, **found, written=_written(strata, closed, weights))


def _roles(dae: Translated, given: Mapping[str, str | Sequence[str]]) -> dict[str, tuple[str, ...]]:
    """Scalar names of T, q and f; ModelError for names and counts that cannot be right."""
    found: dict[str, tuple[str, ...]] = {}
    for role, wanted in given.items():
        wanted = (wanted,) if role == "T" and isinstance(wanted, str) else names(wanted)
        scalars = tuple(n for name in wanted for n in dae.expand(name))
        for place, name in enumerate(scalars):
            alias = dae.reduced.aliases.get(name)
            if alias is None or alias.root is None:
                what = "constant" if alias else "a derivative, a parameter, or follows from other variables"
            elif role != "f" and alias.order > 0:
                what = "a speed"
            elif name in scalars[:place]:
                what = "named twice"
            else:
                continue
            kind = "force, each once" if role == "f" else "coordinate that is free to move, each once"
            raise ModelError(
                f"{ROLES[role]}: {name} of {dae.name} is {what}, expected a {kind}; name another"
            )
        found[role] = scalars
    mobility = dae.mobility
    if any(len(scalars) != mobility for scalars in found.values()):
        counts = ", ".join(f"{len(scalars)} {ROLES[role]}" for role, scalars in found.items())
        raise ModelError(
            f"{dae.name}: found {counts}; mobility {mobility} needs {mobility} of each. Name independent coordinates of the "
            "tool, the driven joints, and one force for each of these"
        )
    return found


def _moved_by_tool(dae: Translated, roles: Mapping[str, Sequence[str]]) -> Translated:
    """The model with the motion of the tool known, and as many inputs unknown."""
    roots = {dae.reduced.aliases[n].root for n in roles["f"]}
    others = [n for n in dae.known if n not in roots]
    if len(dae.known) - len(others) != len(roles["f"]):
        others = []  # the forces are no inputs: all inputs follow from them
    accelerations = [derivative_name(n, 2) for n in (*roles["q"], *roles["T"])]
    try:
        return translate_flat(dae.flat, Request((*roles["T"], *others), tuple(accelerations)), dae.start)
    except StructureError as error:
        raise StructureError(
            f"{', '.join(roles['T'])} cannot be moved at will by {', '.join(roles['f'])}, expected independent coordinates "
            f"of the tool and forces that act on it; name others. Found: {error}"
        ) from error


def _pieces(strata: Strata) -> dict[str, tuple[Cut, list[ca.SX]]]:
    """Constraints, speeds, accelerations and balance: each a cut, and expressions of what is known and found there."""
    residuals, dae = strata.dae.indexed.residuals, strata.dae
    positions = strata.cut(("T", "q"))
    rows = {"constraints": (positions, [residuals[k] for k in positions.left] + list(positions.twins))}
    for name, known, find, words in (
        ("speeds", ("T", "q", "dT"), "dq", "the speed of the tool does not determine that of the joints"),
        ("accelerations", ARGUMENTS["accelerations"], "ddT", "the joints do not determine the tool"),
    ):
        cut = strata.cut(known, find, words)
        rows[name] = (cut, [dae.expression(n) for n in strata.names(find)])
    motion = strata.cut([k for k in EVERYTHING if k != "f"])
    last = {i: times for i, times in motion.left if i in strata.constraints}
    twins = motion.twins[len(motion.twins) - len(positions.twins) :]
    rows["relations"] = (motion, [*(residuals[k] for k in last.items()), *twins])
    passive = strata.cut(FOLLOWS, "s", "the speed of the tool does not determine that of passive joints")
    rows["passive"] = (passive, [dae.expression(n) for n in strata.names("s")])
    balance = strata.cut((*EVERYTHING, "s"))
    left = [k for k in balance.left if not dae.indexed.counts[k[0]]]  # no relation of positions
    rows["balance"] = (balance, [residuals[k] for k in left])
    return rows


def _functions(
    strata: Strata, pieces: Mapping[str, tuple[Cut, list[ca.SX]]], *, by_value: bool
) -> dict[str, ca.Function]:
    """The pieces as functions of what is known and the parameters; by_value: right where pivots vanish, too."""
    found = {name: cut.function(name, e, by_value=by_value) for name, (cut, e) in pieces.items()}
    n = len(strata.roles["T"])
    for name in ("constraints", "balance"):
        if found[name].size1_out(0) != n:
            raise StructureError(
                f"{strata.dae.name}: found {found[name].size1_out(0)} equations of {name} between tool and joints, "
                f"expected {n}; name the coordinates of one tool, the joints that move it, and the forces in these joints"
            )
    return found | {"balance": _with_passive(found["balance"], found.pop("passive"))}


def _with_passive(balance: ca.Function, passive: ca.Function) -> ca.Function:
    """The balance with rates of passive joints that follow from the motion of the tool."""
    kind = ca.SX if _written_out({"balance": balance, "passive": passive}) else ca.MX
    at = {name: kind.sym(name, *balance.size_in(name)) for name in balance.name_in() if name != "s"}
    value = _call(balance, {**at, "s": _call(passive, at)})
    return ca.Function("balance", list(at.values()), [value], list(at), ["value"], {"cse": True})


def _written_out(functions: Mapping[str, ca.Function]) -> bool:
    """Whether all blocks have closed forms, so that nothing is found by iteration."""
    return all(f.is_a("SXFunction") for f in functions.values())


def _call(function: ca.Function, values: Mapping[str, Any]) -> Any:
    return function(*(values[k] for k in function.name_in()))


def _derivative(function: ca.Function, kind: str, at: Mapping[str, Any]) -> Any:
    """Derivative by one argument at rest, where the others are zero but for positions and parameters."""
    rest = {k: type(at["T"]).zeros(*at[k].shape) for k in EVERYTHING}
    rest |= {k: at[k] for k in ("T", "q", "p")}
    found = ca.jacobian(_call(function, {**rest, kind: at[kind]}), at[kind])
    # what it is multiplied with enters the equations linearly
    return ca.densify(ca.substitute(found, at[kind], rest[kind]))


def _systems(
    functions: Mapping[str, ca.Function], at: Mapping[str, Any], weights: ca.DM | None
) -> dict[str, Any]:
    """The four systems as expressions of T, q, their rates and p; weights: K where it is constant."""
    balance, zeros = functions["balance"], {k: type(at["T"]).zeros(*at[k].shape) for k in EVERYTHING}
    inverse, S = _derivative(functions["speeds"], "dT", at), -_derivative(balance, "f", at)
    K = ca.solve(S.T, inverse).T if weights is None else weights
    G = K @ _call(balance, {**zeros, **{k: at[k] for k in ("T", "q", "p")}})
    moving = _call(balance, {**zeros, **{k: at[k] for k in ("T", "q", "dT", "dq", "p")}})
    return {
        "constraints": _call(functions["constraints"], at),
        "velocity_jacobian": inverse,
        "accelerations": _call(functions["accelerations"], at),
        "M1": K @ _derivative(balance, "ddT", at),
        "M2": K @ _derivative(balance, "ddq", at),
        "G": G,
        "bias": K @ moving - G,
    }


def _weights(strata: Strata, functions: Mapping[str, ca.Function]) -> ca.DM | None:
    """K of K S = J^-T if it is constant near the start, else None; StructureError where J^-1 or S is singular there."""
    kind = ca.SX if _written_out(functions) else ca.MX
    at = {k: kind.sym(k, len(strata.names(k))) for k in EVERYTHING} | {"p": strata.numbers}
    inverse, balance = _derivative(functions["speeds"], "dT", at), functions["balance"]
    inertia = _derivative(balance, "ddT", at) + _derivative(balance, "ddq", at) @ inverse
    function = ca.Function(
        "jacobians", [at["T"], at["q"]], [inverse, -_derivative(balance, "f", at), inertia]
    )
    start = np.concatenate([strata.start("T"), strata.start("q")])
    steps = np.random.default_rng(0).uniform(-SPREAD, SPREAD, (POINTS, start.size))
    _require_regular(strata, *(np.array(m) for m in function(*np.split(start, 2))))
    if not _written_out(functions):
        return None
    found = []
    for point in (start, *(start + steps * np.maximum(np.abs(start), 1.0))):
        inverse, S, _ = (np.array(m) for m in function(*np.split(point, 2)))
        if np.all(np.isfinite(inverse)) and np.all(np.isfinite(S)) and np.linalg.cond(S) < 1 / LEAST:
            found.append(np.linalg.solve(S.T, inverse).T)
    weights = found[0]
    if any(np.abs(other - weights).max() > SAME * np.abs(weights).max() for other in found):
        return None
    whole = np.round(weights)
    return ca.DM(np.where(np.abs(weights - whole) < SAME, whole, weights))


def _require_regular(strata: Strata, inverse: np.ndarray, S: np.ndarray, inertia: np.ndarray) -> None:
    """StructureError where speeds do not determine each other, or forces do not act."""
    tool, joints, forces = (", ".join(strata.roles[k]) for k in ROLES)
    for matrix, words in (
        (inverse, f"{joints} and {tool} do not determine each other"),
        (S, f"{forces} do not act independently on {tool}"),
        (inertia, f"{forces} leave accelerations of {tool} undetermined"),
    ):
        sizes = (
            np.linalg.svd(matrix, compute_uv=False)
            if np.all(np.isfinite(matrix))
            else np.array([np.inf, 0.0])
        )
        if not sizes[-1] > LEAST * sizes[0]:
            raise StructureError(
                f"{strata.dae.name}: at the start, {words} (singular values from {sizes[-1]:.2g} to {sizes[0]:.2g}), "
                "expected a regular matrix; name the driven joints and the forces in them, or start away from a singular "
                "position"
            )


NO_FORM = "found by iteration, not in closed form"


def _written(strata: Strata, functions: Mapping[str, ca.Function], weights: ca.DM | None) -> Sections:
    """Titles and rows of text; what occurs more than once is written once, in front."""
    if not _written_out(functions):
        return _written_by_residuals(strata)
    systems = _systems(functions, {**strata.columns, "p": strata.p}, weights)
    systems["bias"] = systems["G"] + systems["bias"]
    systems["accelerations"] = _call(functions["relations"], {**strata.columns, "p": strata.p})
    shapes = {name: systems[name].shape for name in TITLES}
    text = _text(strata, {name: ca.SX(systems[name]) for name in TITLES})
    right = iter(text.expressions)
    sections = [("abbreviations", tuple(f"{name} = {value}" for name, value in text.definitions))]
    for name, shape in shapes.items():
        head = {"velocity_jacobian": "J^-1"}.get(name, name)
        rows = {}
        for j, i in np.ndindex(shape[1], shape[0]):
            left = f"{head}[{i},{j}]" if shape[1] > 1 else f"{head}[{i}]"
            rows[i, j] = ("0" if name in RELATIONS else left, next(right).text)
        shown = [f"{left} = {value}" for _, (left, value) in sorted(rows.items()) if value != "0"]
        sections.append((TITLES[name], tuple(shown) or ("all zero",)))
    return tuple(sections)


def _written_by_residuals(strata: Strata) -> Sections:
    """The constraints as equations of tool, joints and what is found from them by iteration."""
    positions = strata.cut(("T", "q"))
    rest = [*(strata.dae.indexed.residuals[k] for k in positions.left), *positions.twins]
    text = _text(strata, {"constraints": ca.vertcat(*positions.in_known(rest))})
    rows = [f"0 = {value.text}" for value in text.expressions]
    found = ", ".join(s.name() for block in positions.implicit for s in block.tears)
    words = NO_FORM + (f", beginning with the constraints: {found}" if found else "")
    shared = tuple(f"{name} = {value}" for name, value in text.definitions)
    return (
        ("abbreviations", shared),
        (TITLES["constraints"], tuple(rows)),
        ("speeds, accelerations and forces (6.5 to 6.7)", (words,)),
    )


def _text(strata: Strata, values: Mapping[str, ca.SX]) -> Text:
    """Expressions by system, their sums collected; of the bias, what the rates add."""
    symbols, numbers = strata.structural_zeros()
    elements = [e for value in values.values() for e in ca.densify(value).elements()]
    kinds = [name for name, value in values.items() for _ in range(value.numel())]
    if numbers.numel():
        elements = ca.densify(ca.substitute(ca.vertcat(*elements), symbols, numbers)).elements()
    graph = Graph()
    nodes = graph.read(elements)
    rates = {*strata.names("dT"), *strata.names("dq")}
    bias = moving_part(graph, [n for n, kind in zip(nodes, kinds, strict=True) if kind == "bias"], rates)
    nodes = collected(graph, [n for n, kind in zip(nodes, kinds, strict=True) if kind != "bias"] + bias)
    # of an equation that says zero, any multiple says the same
    relations = [kind in ("accelerations",) for kind in kinds]
    return written(
        [without_factor(n) if r else n for n, r in zip(nodes, relations, strict=True)], PlainSyntax()
    )
