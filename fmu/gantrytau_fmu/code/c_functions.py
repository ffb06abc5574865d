"""C functions of a graph of expressions.

An expression that is used once is written where it is used, others get a name. Long functions are cut into pieces
of bounded length, because compilers need more than proportional time for long straight-line code; what one piece
computes for another goes through a work array. What hardly anything calls becomes a table of rows, a tape, which compiles
at once and is small.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import casadi as ca

from gantrytau_fmu.code.expressions import ExpressionGraph
from gantrytau_fmu.code.operations import OPERATIONS, number_text

PIECE = 1500  # operations per C function
LINE = 160  # characters of an expression that is still written where it is used
REPEATING = {name for name, form in OPERATIONS.items() if form.count("{0}") > 1}
HOISTED = "c"
PARAMETERS = "const double *const *a, double *restrict r, double *restrict w"


@dataclass(frozen=True, eq=False)
class CFunction:
    """`static void name(const double *const *a, double *r, double *w)`; work: length of w."""

    name: str
    code: str
    work: int
    operations: int


def c_function(
    graph: ExpressionGraph,
    name: str,
    roots: Sequence[int],
    *,
    hoisting: bool = False,
    mark: str = "",
    flag: int | None = None,
) -> CFunction:
    """The function whose results r are the roots, from the arrays of the graph, then the hoisted one.

    hoisting: the one that fills the hoisted array; mark: for the compiler, as `GT_SELDOM `; flag: a node whose
    value goes to w[GT_TRUSTED].
    """
    flags = [] if flag is None else [flag]
    known = {} if hoisting else graph.hoisted
    order = [n for n in graph.reached([*roots, *flags], known=known) if n not in known and graph.inside(n)]
    cut = [order[k : k + PIECE] for k in range(0, len(order), PIECE)] or [[]]
    home = {number: k for k, part in enumerate(cut) for number in part}
    uses = Counter(i for n in order for i in graph.inside(n)) + Counter([*roots, *flags])
    uses += Counter(i for n in order if graph.nodes[n][0] in REPEATING for i in graph.inside(n))
    shared: dict[int, int] = {}
    for number in order:
        for i in graph.inside(number):
            if home.get(i, home[number]) != home[number]:
                shared.setdefault(i, len(shared))
    pieces = [_Piece(graph, k, known, home, shared, uses) for k in range(len(cut))]
    for piece, part in zip(pieces, cut, strict=True):
        piece.write(part)
    for place, root in enumerate(roots):
        pieces[home.get(root, 0)].result(f"r[{place}]", root)
    for root in flags:
        pieces[home.get(root, 0)].result("w[GT_TRUSTED]", root)
    if len(pieces) == 1:
        return CFunction(name, mark + _whole(name, graph, pieces[0].lines), 0, len(order))
    code = [mark + _whole(f"{name}_{k}", graph, piece.lines) for k, piece in enumerate(pieces)]
    code.append(_whole(name, graph, [f"  {name}_{k}(a, r, w);" for k in range(len(pieces))]))
    return CFunction(name, "".join(code), len(shared), len(order))


@dataclass(eq=False)
class _Piece:
    """One C function of the graph while it is written; texts: expressions by node, where they have one here."""

    graph: ExpressionGraph
    number: int
    known: Mapping[int, int]
    home: Mapping[int, int]
    shared: Mapping[int, int]
    uses: Mapping[int, int]
    lines: list[str] = field(default_factory=list)
    texts: dict[int, str] = field(default_factory=dict)

    def write(self, order: Sequence[int]) -> None:
        names = 0
        for node in order:
            operation, *inside = self.graph.nodes[node]
            text = OPERATIONS[operation].format(*(self.word(i) for i in inside))
            if self.uses[node] == 1 and node not in self.shared and len(text) < LINE:
                self.texts[node] = f"({text})" if not text.endswith(")") or " " in text else text
                continue
            self.texts[node] = f"v{names}"
            names += 1
            self.lines.append(f"  const double {self.texts[node]} = {text};")
            if node in self.shared:
                self.lines.append(f"  w[{self.shared[node]}] = {self.texts[node]};")

    def word(self, node: int) -> str:
        """How a node is called in this piece."""
        if node in self.known:
            return f"{HOISTED}[{self.known[node]}]"
        key = self.graph.nodes[node]
        if key[0] == "CONST":
            return number_text(key[1])
        if key[0] == "INPUT":
            return f"{key[1]}[{key[2]}]"
        return self.texts[node] if self.home[node] == self.number else f"w[{self.shared[node]}]"

    def result(self, place: str, root: int) -> None:
        self.lines.append(f"  {place} = {self.word(root)};")


def _whole(name: str, graph: ExpressionGraph, body: Sequence[str]) -> str:
    text = "".join(body)
    used = [(k, n) for k, n in enumerate([*graph.arrays, HOISTED]) if f"{n}[" in text]
    lines = [
        f"static void {name}({PARAMETERS}) {{",
        *(f"  const double *const {n} = a[{k}];" for k, n in used),
        *body,
        "  (void)a; (void)r; (void)w;" + "".join(f" (void){n};" for _, n in used),
        "}",
    ]
    return "\n".join(lines) + "\n"


def tape(graph: ExpressionGraph, functions: Mapping[str, tuple[Sequence[int], int, int]]) -> CFunction:
    """The functions that runtime/tape.c follows row by row.

    functions: by name the roots, and from which array to before which the results are their changes along the seeds;
    none of the arrays for the values of the roots.
    """
    order = graph.reached(root for roots, *_ in functions.values() for root in roots)
    place = {number: k for k, number in enumerate(order)}
    codes = {"INPUT": 0, "CONST": 1}
    numbers: dict[str, int] = {}
    rows = []
    for k, number in enumerate(order):
        kind, *inside = graph.nodes[number]
        code = codes.setdefault(kind, len(codes))
        if kind == "INPUT":
            rows.append((code, graph.arrays.index(inside[0]), inside[1]))
        elif kind == "CONST":
            rows.append((code, numbers.setdefault(number_text(inside[0]), len(numbers)), 0))
        else:
            back = [k - place[i] for i in inside]
            rows.append((code, back[0], back[-1]))
    results: list[int] = []
    calls = []
    for name, (roots, first, last) in functions.items():
        body = f"  gt_played(a, r, w, {first}, {last}, {len(results)}, {len(roots)});"
        calls.append(_whole(name, graph, [body]))
        results += [place[root] for root in roots]
    operations = [_operation(name) for name in list(codes)[2:]]
    word = "short" if max([len(rows), *(number for row in rows for number in row)]) < 1 << 16 else "int"
    lines = [
        *(operation.code for operation in operations),
        f"#define GT_ROWS {len(rows)}",
        f"#define GT_FIRST_SEED {graph.arrays.index('dt')}",
        f"typedef unsigned {word} gt_word;",
        f"static const gt_word gt_rows[][3] = {{{', '.join(map(_braced, rows)) or '{0}'}}};",
        f"static const gt_word gt_results[] = {{{', '.join(map(str, results)) or '0'}}};",
        f"static const double gt_row_numbers[] = {{{', '.join(numbers) or '0'}}};",
        f"static void (*const gt_operations[])({PARAMETERS}) = {{{', '.join(o.name for o in operations) or '0'}}};",
        '#include "tape.c"',
        *calls,
    ]
    return CFunction("gt_play", "\n".join(lines) + "\n", 2 * len(rows), 0)


def _braced(row: tuple[int, int, int]) -> str:
    return "{" + ",".join(map(str, row)) + "}"


def _operation(name: str) -> CFunction:
    """One operation: its value and its derivatives by its operands, a[0]."""
    operands, code = ca.SX.sym("x", 2), getattr(ca, f"OP_{name}")
    x, y = operands.elements()
    value = ca.SX.binary(code, x, y) if "{1}" in OPERATIONS[name] else ca.SX.unary(code, x)
    graph = ExpressionGraph(("x",))
    roots = graph.enter(name, {"x": operands}, ca.vertcat(value, ca.jacobian(value, operands).T))
    return c_function(graph, f"gt_of_{name.lower()}", roots)
