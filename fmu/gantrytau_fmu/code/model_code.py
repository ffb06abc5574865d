"""C of one model: its functions and tables, as the runtime expects them (runtime/instance.c, solve.c)."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import casadi as ca

from gantrytau_fmu.code.arrays import numbers_of
from gantrytau_fmu.code.c_functions import PARAMETERS, CFunction, c_function, tape
from gantrytau_fmu.code.contents import Contents
from gantrytau_fmu.code.expressions import ExpressionGraph
from gantrytau_fmu.code.formulas import Formulas
from gantrytau_fmu.code.impulse_formulas import ImpulseFormulas
from gantrytau_fmu.code.model_graph import ARRAYS, ModelGraph, is_seldom
from gantrytau_fmu.code.operations import number_text
from gantrytau_fmu.description import FmuVariable


@dataclass(frozen=True, eq=False)
class ModelCode:
    """model.c; operations: in all its functions."""

    text: str
    operations: int


def model_code(
    model: ModelGraph,
    contents: Contents,
    *,
    name: str,
    token: str,
    interfaces: Iterable[str],
    tolerance: float,
) -> ModelCode:
    """The text of model.c."""
    graph, formulas = model.graph, model.formulas
    pieces = [c_function(graph, "gt_fill", list(graph.hoisted), hoisting=True), tape(graph, model.taped)]
    for n, roots in model.roots.items():
        by_value = n in model.careful or f"{n}_careful" in model.taped
        pieces += _by_value(model, n, roots) if by_value else [_function(graph, n, roots)]
    defines = dict(
        GT_NAME=_quoted(name),
        GT_TOKEN=_quoted(token),
        GT_HAS_MODEL_EXCHANGE=int("model-exchange" in set(interfaces)),
        GT_HAS_CO_SIMULATION=int("co-simulation" in set(interfaces)),
        GT_TOLERANCE=number_text(tolerance),
        GT_LIMITS=len(contents.limited),
        **_sizes(model, len(contents.entries), pieces),
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
    lines += _tables(formulas, contents)
    lines.append(_texts("gt_pivot_names", _moving(model)))
    return ModelCode("\n".join(lines) + "\n", sum(p.operations for p in pieces))


def _function(graph: ExpressionGraph, name: str, roots: Sequence[int]) -> CFunction:
    return c_function(graph, name, roots, mark=_mark(name))


def _mark(name: str) -> str:
    return "GT_SELDOM " if is_seldom(name) else ""


def _by_value(model: ModelGraph, name: str, roots: Sequence[int]) -> list[CFunction]:
    """A function that is computed with the pivots of the closed forms, and anew with others where these are small."""
    assert model.trusted is not None
    quick = c_function(model.graph, f"{name}_quick", roots, mark=_mark(name), flag=model.trusted)
    careful = [
        c_function(model.graph, f"{name}_careful", roots, mark="GT_SELDOM ")
        for roots in (model.careful.get(name),)
        if roots
    ]
    lines = [
        f"static void {name}({PARAMETERS}) {{",
        f"  {name}_quick(a, r, w);",
        f"  if (!(w[GT_TRUSTED] > 0)) {name}_careful(a, r, w);",
        "}",
    ]
    return [quick, *careful, CFunction(name, "\n".join(lines) + "\n", 0, 0)]


def _moving(model: ModelGraph) -> list[str]:
    """For each divisor a variable that moves it, a state if there is one."""
    formulas, graph, found = model.formulas, model.graph, []
    names = {
        "x": formulas.states,
        "u": (*formulas.inputs, *formulas.held, *formulas.discretes, *formulas.delays),
        "z": formulas.z_names,
    }
    for divisor in model.roots["gt_pivots"]:
        leaves = [graph.nodes[n] for n in graph.reached([divisor])]
        places = [(array, index) for kind, array, index in (leaf for leaf in leaves if leaf[0] == "INPUT")]
        moved = [
            names[array][index] for array in ("x", "z", "u") for where, index in places if where == array
        ]
        found.append(moved[0] if moved else "time")
    return found


def _sizes(model: ModelGraph, variables: int, pieces: Sequence[CFunction]) -> dict[str, int]:
    formulas = model.formulas
    counts, turns = [len(b.names) for b in formulas.blocks], formulas.switching.turns
    return dict(
        GT_VARIABLES=variables,
        GT_STATES=len(formulas.states),
        GT_INPUTS=len(formulas.inputs),
        GT_HELD_COUNT=len(formulas.held),
        GT_DISCRETES=len(formulas.discretes),
        GT_WHENS=len(formulas.jump.labels),
        GT_REINITS=len(formulas.jump.states),
        GT_KNOWN=formulas.arrays["u"].numel(),
        GT_DELAYS=len(formulas.delays),
        GT_ALGEBRAICS=sum(counts),
        GT_BLOCKS=len(counts),
        GT_LARGEST_BLOCK=max(counts, default=0),
        GT_MATRICES=sum(n * n for n in counts),
        GT_PARAMETERS=len(formulas.parameters),
        GT_OUTPUTS=len(model.outputs),
        GT_LEVELS=len(formulas.impulses.by_level),
        GT_UNKNOWNS=formulas.impulses.j.numel() // max(len(formulas.impulses.by_level), 1),
        GT_SYMBOLS=formulas.impulses.y.numel(),
        GT_FRICTIONS=len(formulas.frictions),
        GT_TURNS=len(turns),
        GT_GAPS=len(turns) + sum(turn.counts for turn in turns),
        GT_TURNS_OF_BLOCKS=int(ca.depends_on(formulas.switching.margins, formulas.arrays["z"])),
        GT_CLOCKS=formulas.periods.numel(),
        GT_INITIAL=formulas.starts.equations.numel(),
        GT_ROOTS=len(formulas.roots),
        GT_ARRAYS=len(ARRAYS),
        GT_HOISTED=len(model.graph.hoisted),
        GT_TRUSTED=max((p.work for p in pieces), default=0),
        GT_WORK=max((p.work for p in pieces), default=0) + (model.trusted is not None),
        GT_PIVOTS=len(model.roots["gt_pivots"]),
    )


def _tables(formulas: Formulas, contents: Contents) -> list[str]:
    variables, switching = contents.entries, formulas.switching
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
        f"static const gt_limit gt_limits[] = {{{', '.join(map(_limit, contents.limited)) or '{0, 0, 0, 0}'}}};",
        _texts("gt_limit_units", [f" {v.unit}" if v.unit not in ("", "1") else "" for v in contents.limited]),
        _numbers("gt_constants", contents.constants),
        _numbers("gt_start_x", at["x"]),
        _numbers("gt_start_u", at["u"]),
        _numbers("gt_start_z", at["z"]),
        _numbers("gt_start_p", at["p"]),
        _numbers("gt_start_m", at["m"]),
        _numbers("gt_x_nominals", contents.nominals),
        _numbers("gt_z_nominals", contents.z_nominals),
        _integers("gt_initial_states", formulas.starts.solved),
        _integers("gt_friction_unknowns", [formulas.z_names.index(n) for n in formulas.frictions]),
        _integers("gt_held_clocks", formulas.clocks),
        _integers("gt_turn_closed", [turn.closed for turn in switching.turns]),
        _integers("gt_turn_counts", [turn.counts for turn in switching.turns]),
        _integers("gt_turn_timed", switching.timed),
        _texts("gt_conditions", switching.conditions),
        _integers("gt_reinit_states", formulas.jump.states),
        _texts("gt_when_names", formulas.jump.labels),
        _texts("gt_when_ends", formulas.jump.messages),
        _texts("gt_when_fails", formulas.jump.failures),
        _integers("gt_when_initially", formulas.jump.initially),
        _integers("gt_when_waits", formulas.jump.waits),
        _texts("gt_x_names", formulas.states),
        _texts("gt_z_names", formulas.z_names),
        _texts("gt_root_names", formulas.roots),
        _texts("gt_held_names", (*formulas.held, *formulas.discretes)),
        *([_texts("gt_delay_names", formulas.delays)] if formulas.delays else []),
        _texts("gt_clock_names", [formulas.held[k] for k in held]),
        *(_of_impulses(formulas.impulses) if formulas.impulses.by_level else []),
        "typedef struct {",
        f"  void (*residual)({PARAMETERS});",
        f"  void (*jacobian)({PARAMETERS});",
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


def _of_impulses(impulses: ImpulseFormulas) -> list[str]:
    levels = ", ".join(f"gt_level_{k}" for k in range(1, len(impulses.by_level) + 1))
    return [
        f"static void (*const gt_levels[])({PARAMETERS}) = {{{levels}}};",
        _texts("gt_unknown_names", impulses.levels.unknowns),
        _integers("gt_unknown_orders", impulses.levels.orders),
        _integers("gt_equation_counts", impulses.levels.counts),
        _integers("gt_unknown_ends", impulses.levels.ends),
        _integers("gt_state_symbols", impulses.states),
    ]


def _limit(variable: FmuVariable) -> str:
    low = "-INFINITY" if variable.min is None else number_text(variable.min)
    high = "INFINITY" if variable.max is None else number_text(variable.max)
    return f"{{{variable.reference}, {low}, {high}, {number_text(variable.nominal or 1.0)}}}"


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'


def _numbers(name: str, values: Iterable[float]) -> str:
    return f"static const double {name}[] = {{{', '.join(map(number_text, values)) or '0'}}};"


def _integers(name: str, values: Iterable[int]) -> str:
    return f"static const int {name}[] = {{{', '.join(str(int(v)) for v in values) or '0'}}};"


def _texts(name: str, values: Iterable[str]) -> str:
    return f"static const char *const {name}[] = {{{', '.join(map(_quoted, values)) or '0'}}};"
