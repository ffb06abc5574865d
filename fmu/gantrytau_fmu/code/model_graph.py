"""All formulas of an FMU in one graph, by the C functions that they become."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce

import casadi as ca

from gantrytau_fmu.code.arrays import column
from gantrytau_fmu.code.expressions import ExpressionGraph
from gantrytau_fmu.code.formulas import Formulas

SEEDS = ("dt", "dx", "du", "dz", "dp")
OF_DELAYS = ("gt_past", "gt_past_rates", "gt_delay_times")
SELDOM = {  # small code is worth more than fast one
    "gt_outputs",
    "gt_starts",
    "gt_initial",
    "gt_forward",
    "gt_initial_slopes",
    "gt_pivots",
    "gt_jump",
    "gt_symbols",
    "gt_impulses",
}
ARRAYS = ("t", "x", "u", "z", "p", "m", "e", *SEEDS, "y", "j")


@dataclass(frozen=True, eq=False)
class ModelGraph:
    """The graph, and its nodes that are the results of each function.

    outputs: the expressions that differ; places: name of an output -> place among them; careful: the results of functions
    that take other pivots where `trusted` is not 1; taped: results of functions that hardly anything calls, by their full
    names, with the first array and the last, excluded, along which changes are asked for.
    """

    formulas: Formulas
    graph: ExpressionGraph
    roots: Mapping[str, list[int]]
    outputs: tuple[ca.SX, ...]
    places: Mapping[str, int]
    careful: Mapping[str, list[int]]
    taped: Mapping[str, tuple[list[int], int, int]]
    trusted: int | None


def is_seldom(name: str) -> bool:
    """Whether small code is worth more than fast one."""
    return name in SELDOM or name.startswith("gt_level_")


def entered(formulas: Formulas) -> ModelGraph:
    """The graph of a model, whole: no function is added to it later."""
    graph = ExpressionGraph(ARRAYS)
    symbols = _symbols(formulas)
    found = graph.enter("outputs", symbols, column(list(formulas.outputs.values())))
    first: dict[int, str] = {}
    for name, root in zip(formulas.outputs, found, strict=True):
        first.setdefault(root, name)
    place = {root: k for k, root in enumerate(first)}
    outputs = tuple(formulas.outputs[name] for name in first.values())
    places = {name: place[root] for name, root in zip(formulas.outputs, found, strict=True)}
    functions = _functions(formulas, symbols, column(outputs)) | _changes(formulas, symbols, column(outputs))
    roots = {name: graph.enter(name, symbols, expression) for name, expression in functions.items()}
    solving = [name for name in functions if name == "gt_rates" or name.startswith("gt_residual_")]
    roots["gt_pivots"] = graph.divisors(root for name in solving for root in roots[name])
    careful, taped, trusted, everything = {}, {}, None, [*solving, "gt_outputs"]
    found = roots
    if formulas.careful is not None:
        other = _symbols(formulas.careful)
        wanted = column([formulas.careful.outputs[name] for name in first.values()])
        functions = _functions(formulas.careful, other, wanted)
        found = {name: graph.enter(name, other, expression) for name, expression in functions.items()}
        differing = [name for name in found if found[name] != roots[name]]
        careful = {name: found[name] for name in differing if not is_seldom(name)}
        taped = {f"{name}_careful": (found[name], 0, 0) for name in differing if is_seldom(name)}
        if set(everything) & set(differing):
            taped["gt_forward_careful"] = (_together(found, everything), 0, 4)
        if "gt_initial" in differing:
            taped["gt_initial_slopes_careful"] = (found["gt_initial"], 0, 5)
        holds = [margin > 0 for margin in formulas.margins.elements()]
        (trusted,) = graph.enter("trusted", symbols, reduce(ca.logic_and, holds))
    taped["gt_by_parameters"] = (_together(found, everything), 4, 5)
    graph.hoist(root for found in (*roots.values(), *careful.values()) for root in found)
    return ModelGraph(formulas, graph, roots, outputs, places, careful, taped, trusted)


def _together(roots: Mapping[str, list[int]], names: Sequence[str]) -> list[int]:
    return [root for name in names for root in roots[name]]


def _symbols(formulas: Formulas) -> dict[str, ca.SX]:
    return {**formulas.arrays, **{s: ca.SX.sym(s, formulas.arrays[s[1]].numel()) for s in SEEDS}}


def _functions(formulas: Formulas, s: Mapping[str, ca.SX], wanted: ca.SX) -> dict[str, ca.SX]:
    """The results of the C functions by their names."""
    point = ca.vertcat(s["t"], s["x"], s["u"], s["z"])
    way = ca.vertcat(s["dt"], s["dx"], s["du"], s["dz"])
    phases = _along(formulas.switching.phases, point, way).elements()
    pace = reduce(ca.fmax, [ca.fabs(rate) for rate in phases], ca.SX(0.0))
    named = {
        "gt_rates": formulas.rates,
        "gt_outputs": wanted,
        "gt_starts": formulas.starts.values,
        "gt_initial": formulas.starts.equations,
        "gt_friction": formulas.friction,
        "gt_roots": column(list(formulas.roots.values())),
        "gt_periods": formulas.periods,
        "gt_samples": formulas.samples,
        "gt_conditions_hold": formulas.jump.conditions,
        "gt_jump": column([formulas.jump.acts, formulas.jump.discretes, formulas.jump.values]),
        "gt_past": formulas.past,
        "gt_past_rates": _along(formulas.past, point, way),
        "gt_delay_times": formulas.delay_times,
        "gt_turning": column([formulas.switching.margins, formulas.switching.noise]),
        "gt_turning_rates": column([_along(formulas.switching.margins, point, way), pace]),
    }
    if not formulas.delays:
        named = {name: found for name, found in named.items() if name not in OF_DELAYS}
    if formulas.impulses.by_level:
        named |= {"gt_symbols": formulas.impulses.symbols, "gt_impulses": formulas.impulses.jacobian}
        named |= {f"gt_level_{k}": e for k, e in enumerate(formulas.impulses.by_level, start=1)}
    for k, block in enumerate(formulas.blocks):
        named[f"gt_residual_{k}"] = block.residual
        named[f"gt_jacobian_{k}"] = ca.vec(ca.densify(ca.jacobian(block.residual, block.unknowns)))
    return named


def _changes(formulas: Formulas, s: Mapping[str, ca.SX], wanted: ca.SX) -> dict[str, ca.SX]:
    """The C functions of changes along the seeds, by their names."""
    everything = column([formulas.rates, formulas.residuals, wanted])
    point, way = [ca.vertcat(*(s[d + name] for name in "txuz")) for d in ("", "d")]
    initial = _along(formulas.starts.equations, ca.vertcat(point, s["p"]), ca.vertcat(way, s["dp"]))
    return {"gt_forward": _along(everything, point, way), "gt_initial_slopes": initial}


def _along(expression: ca.SX, point: ca.SX, way: ca.SX) -> ca.SX:
    return (
        ca.jtimes(expression, point, way)
        if expression.numel() and point.numel()
        else ca.SX.zeros(*expression.shape)
    )
