"""C of one model: its functions and tables, as the runtime expects them (runtime/instance.c, solve.c)."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import casadi as ca

from gantrytau_fmu.code.arrays import column, numbers_of
from gantrytau_fmu.code.c_functions import CFunction, c_function
from gantrytau_fmu.code.expressions import Graph
from gantrytau_fmu.code.formulas import Formulas
from gantrytau_fmu.code.operations import number_text

SEEDS = ("dt", "dx", "du", "dz", "dp")
SELDOM = {
    "gt_outputs",
    "gt_starts",
    "gt_initial",
    "gt_forward",
    "gt_by_parameters",
    "gt_initial_slopes",
    "gt_pivots",
}
ARRAYS = ("t", "x", "u", "z", "p", "m", *SEEDS)


@dataclass(frozen=True)
class Entry:
    """A row of the table of variables: kind as in core.h, without GT_; index within the kind."""

    kind: str
    index: int
    fixed: bool
    name: str


@dataclass(frozen=True, eq=False)
class ModelCode:
    """model.c; operations: in all its functions."""

    text: str
    operations: int


@dataclass(eq=False)
class _Writer:
    formulas: Formulas
    graph: Graph
    symbols: dict[str, ca.SX]
    roots: dict[str, list[int]]

    def enter(self, name: str, expression: ca.SX) -> list[int]:
        self.roots[name] = self.graph.enter(name, self.symbols, expression)
        return self.roots[name]


def output_places(formulas: Formulas) -> tuple[Graph, dict[str, int], list[ca.SX]]:
    """A graph with the outputs, the place of each, and the expressions that differ."""
    graph = Graph(ARRAYS)
    symbols = _symbols(formulas)
    roots = graph.enter("outputs", symbols, column(list(formulas.outputs.values())))
    places, unique, first = {}, {}, []
    for (name, expression), root in zip(formulas.outputs.items(), roots, strict=True):
        if root not in unique:
            unique[root] = len(unique)
            first.append(expression)
        places[name] = unique[root]
    return graph, places, first


def _symbols(formulas: Formulas) -> dict[str, ca.SX]:
    seeds = {s: ca.SX.sym(s, formulas.arrays[s[1]].numel()) for s in SEEDS}
    return {**formulas.arrays, **seeds}


def model_code(
    formulas: Formulas,
    *,
    name: str,
    token: str,
    variables: Sequence[Entry],
    constants: Sequence[float],
    nominals: Sequence[float],
    interfaces: Iterable[str],
    tolerance: float,
    outputs: Sequence[ca.SX],
    graph: Graph,
) -> ModelCode:
    """The text of model.c; outputs, graph: as `output_places` found them."""
    writer = _Writer(formulas, graph, _symbols(formulas), {})
    pieces = _functions(writer, outputs)
    sizes = _sizes(formulas, len(outputs), variables, pieces, len(graph.hoisted))
    sizes["GT_PIVOTS"] = len(writer.roots["gt_pivots"])
    defines = dict(
        GT_NAME=_quoted(name),
        GT_TOKEN=_quoted(token),
        GT_HAS_MODEL_EXCHANGE=int("model-exchange" in set(interfaces)),
        GT_HAS_CO_SIMULATION=int("co-simulation" in set(interfaces)),
        GT_TOLERANCE=number_text(tolerance),
        **sizes,
    )
    lines = [
        "/* Generated from a model; changes are lost. */",
        "#include <math.h>",
        '#include "core.h"',
        '#include "functions.c"',
        "",
    ]
    lines += [f"#define {key} {value}" for key, value in defines.items()]
    lines += ["", *(piece.code for piece in pieces)]
    lines += _tables(formulas, variables, constants, nominals)
    lines.append(_texts("gt_pivot_names", _moving(writer)))
    return ModelCode("\n".join(lines) + "\n", sum(p.operations for p in pieces))


def _functions(writer: _Writer, outputs: Sequence[ca.SX]) -> list[CFunction]:
    formulas, s = writer.formulas, writer.symbols
    point = ca.vertcat(s["t"], s["x"], s["u"], s["z"])
    way = ca.vertcat(s["dt"], s["dx"], s["du"], s["dz"])
    wanted = column(outputs)
    everything = column([formulas.rates, formulas.residuals, wanted])
    named = {
        "gt_rates": formulas.rates,
        "gt_outputs": wanted,
        "gt_starts": formulas.starts.values,
        "gt_initial": formulas.starts.equations,
        "gt_friction": formulas.friction,
        "gt_roots": column(list(formulas.roots.values())),
        "gt_periods": formulas.periods,
        "gt_samples": formulas.samples,
        "gt_forward": _along(everything, point, way),
        "gt_by_parameters": _along(everything, s["p"], s["dp"]),
        "gt_initial_slopes": _along(
            formulas.starts.equations, ca.vertcat(point, s["p"]), ca.vertcat(way, s["dp"])
        ),
    }
    for k, block in enumerate(formulas.blocks):
        named[f"gt_residual_{k}"] = block.residual
        named[f"gt_jacobian_{k}"] = ca.vec(ca.densify(ca.jacobian(block.residual, block.unknowns)))
    for name, expression in named.items():
        writer.enter(name, expression)
    graph = writer.graph
    solving = [n for n in named if n == "gt_rates" or n.startswith("gt_residual_")]
    writer.roots["gt_pivots"] = graph.divisors(root for name in solving for root in writer.roots[name])
    graph.hoist(root for name, roots in writer.roots.items() for root in roots)
    fill = c_function(graph, "gt_fill", list(graph.hoisted), hoisting=True)
    return [fill, *(c_function(graph, n, roots, seldom=n in SELDOM) for n, roots in writer.roots.items())]


def _moving(writer: _Writer) -> list[str]:
    """For each divisor a variable that moves it, a state if there is one."""
    formulas, found = writer.formulas, []
    names = {"x": formulas.states, "u": (*formulas.inputs, *formulas.held), "z": formulas.z_names}
    for divisor in writer.roots["gt_pivots"]:
        leaves = [writer.graph.nodes[n] for n in writer.graph.reached([divisor])]
        places = [(array, index) for kind, array, index in (leaf for leaf in leaves if leaf[0] == "INPUT")]
        moved = [
            names[array][index] for array in ("x", "z", "u") for where, index in places if where == array
        ]
        found.append(moved[0] if moved else "time")
    return found


def _along(expression: ca.SX, point: ca.SX, way: ca.SX) -> ca.SX:
    return (
        ca.jtimes(expression, point, way)
        if expression.numel() and point.numel()
        else ca.SX.zeros(*expression.shape)
    )


def _sizes(
    formulas: Formulas, outputs: int, variables: Sequence[Entry], pieces: Sequence[CFunction], hoisted: int
) -> dict:
    counts = [len(b.names) for b in formulas.blocks]
    return dict(
        GT_VARIABLES=len(variables),
        GT_STATES=len(formulas.states),
        GT_INPUTS=len(formulas.inputs),
        GT_HELD_COUNT=len(formulas.held),
        GT_KNOWN=len(formulas.inputs) + len(formulas.held),
        GT_ALGEBRAICS=sum(counts),
        GT_BLOCKS=len(counts),
        GT_LARGEST_BLOCK=max(counts, default=0),
        GT_MATRICES=sum(n * n for n in counts),
        GT_PARAMETERS=len(formulas.parameters),
        GT_OUTPUTS=outputs,
        GT_MODES=len(formulas.frictions),
        GT_INDICATORS=len(formulas.frictions),
        GT_CLOCKS=formulas.periods.numel(),
        GT_INITIAL=formulas.starts.equations.numel(),
        GT_ROOTS=len(formulas.roots),
        GT_ARRAYS=len(ARRAYS),
        GT_HOISTED=hoisted,
        GT_WORK=max((p.work for p in pieces), default=0),
    )


def _tables(
    formulas: Formulas, variables: Sequence[Entry], constants: Sequence[float], nominals: Sequence[float]
) -> list[str]:
    at = numbers_of(formulas.dae, formulas.arrays)
    held = [formulas.clocks.index(k) for k in range(formulas.periods.numel())]
    lines = [
        "static const gt_variable gt_variables[] = {",
        *(f"  {{GT_{v.kind}, {int(v.fixed)}, {v.index}}}," for v in variables),
        "};",
        # no pointers: each would have to be relocated when the library is loaded
        f"static const char gt_variable_names[][{max(len(v.name) for v in variables) + 1}] = {{",
        *(f"  {_quoted(v.name)}," for v in variables),
        "};",
        _numbers("gt_constants", constants),
        _numbers("gt_start_x", at["x"]),
        _numbers("gt_start_u", at["u"]),
        _numbers("gt_start_z", at["z"]),
        _numbers("gt_start_p", at["p"]),
        _numbers("gt_x_nominals", nominals),
        _integers("gt_initial_states", formulas.starts.solved),
        _integers("gt_friction_unknowns", [formulas.z_names.index(n) for n in formulas.frictions]),
        _integers("gt_held_clocks", formulas.clocks),
        _texts("gt_x_names", formulas.states),
        _texts("gt_z_names", formulas.z_names),
        _texts("gt_root_names", formulas.roots),
        _texts("gt_held_names", formulas.held),
        _texts("gt_clock_names", [formulas.held[k] for k in held]),
        "typedef struct {",
        "  void (*residual)(const double *const *a, double *restrict r, double *restrict w);",
        "  void (*jacobian)(const double *const *a, double *restrict r, double *restrict w);",
        "  int first, count, matrix, linear, frictions;",
        "} gt_block;",
    ]
    first = matrix = 0
    rows = []
    for k, block in enumerate(formulas.blocks):
        count = len(block.names)
        numbers = f"{first}, {count}, {matrix}, {int(block.linear)}, {int(block.frictions)}"
        rows.append(f"{{gt_residual_{k}, gt_jacobian_{k}, {numbers}}}")
        first, matrix = first + count, matrix + count * count
    rows = rows or ["{0, 0, 0, 0, 0, 0, 0}"]
    return [*lines, f"static const gt_block gt_blocks[] = {{{', '.join(rows)}}};"]


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def _numbers(name: str, values: Iterable[float]) -> str:
    return f"static const double {name}[] = {{{', '.join(map(number_text, values)) or '0'}}};"


def _integers(name: str, values: Iterable[int]) -> str:
    return f"static const int {name}[] = {{{', '.join(map(str, values)) or '0'}}};"


def _texts(name: str, values: Iterable[str]) -> str:
    return f"static const char *const {name}[] = {{{', '.join(map(_quoted, values)) or '0'}}};"
