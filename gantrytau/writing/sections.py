"""A translated model as sections to be read: one per block, in the order of solution."""

from collections.abc import Iterable
from dataclasses import dataclass

import casadi as ca

from gantrytau.compiler.index_reduction import Key
from gantrytau.compiler.symbol_spaces import column
from gantrytau.compiler.translated import Translated
from gantrytau.language.statements import Equation
from gantrytau.writing.collect import collected
from gantrytau.writing.graph import Graph
from gantrytau.writing.subexpressions import Text, located, written
from gantrytau.writing.syntax import Syntax


@dataclass(frozen=True, eq=False)
class Line:
    """`left` = `right`; left None: zero. `determines` names the unknown that an implicit equation yields."""

    left: str | None
    right: ca.SX
    determines: str = ""


@dataclass(frozen=True, eq=False)
class Section:
    """One block: its lines, and where its equations come from.

    kind: how it is solved; unknowns: names; torn: how many unknowns are found first; keys: its equations.
    """

    number: int
    kind: str
    unknowns: tuple[str, ...]
    torn: int
    origins: tuple[str, ...]
    lines: tuple[Line, ...]
    keys: tuple[Key, ...] = ()

    @property
    def leaves(self) -> tuple[str, ...]:
        """Names of the symbols that stand in its lines."""
        return symbol_names(line.right for line in self.lines)

    @property
    def single(self) -> bool:
        """Whether it is one unknown in closed form."""
        return len(self.lines) == 1 and self.lines[0].left is not None

    @property
    def origin(self) -> str:
        """Where its equations come from, in one line."""
        return "; ".join(self.origins)

    @property
    def title(self) -> str:
        """'linear block of 48 unknowns, torn to 5'."""
        if self.single:
            return self.kind
        count = len(self.unknowns)
        plural = "" if count == 1 else "s"
        return f"{self.kind} block of {count} unknown{plural}, torn to {self.torn}"


def sections(dae: Translated) -> list[Section]:
    """The blocks of a Dae as lines to be read."""
    found: list[Section] = []
    for number, block in enumerate(dae.blocks, start=1):
        if len(block.unknowns) == 1 and block.solution is not None:
            (value,) = block.solution
            lines = [Line(block.unknowns[0], value)]
        else:
            pairs = zip(block.tears, block.residuals, strict=True)
            lines = [Line(None, residual, tear.name()) for tear, residual in pairs]
            lines += [Line(symbol.name(), value) for symbol, value in block.inner]
        origins = origin_words(dae, block.equations)
        torn = len(block.tears)
        found.append(
            Section(number, block.kind, block.unknowns, torn, origins, tuple(lines), block.equations)
        )
    return found


def symbol_names(expressions: Iterable[ca.SX]) -> tuple[str, ...]:
    """Names of the symbols in some expressions."""
    return tuple(leaf.name() for leaf in ca.symvar(ca.SX(column(list(expressions)))))


def section_text(section: Section, syntax: Syntax) -> Text:
    """The right-hand sides of a block, equal terms collected; a ModelError about them names their origin."""
    graph = Graph()
    with located(section.origin):
        return written(collected(graph, graph.read(line.right for line in section.lines)), syntax)


def origin_words(dae: Translated, equations: Iterable[Key]) -> tuple[str, ...]:
    """Where equations come from, rows of one vector equation put together: 'tool (Tool), equation 2, rows 0 to 2'."""
    return tuple(name + words for name, words, _ in origins_of(dae, equations))


def origins_of(dae: Translated, equations: Iterable[Key]) -> list[tuple[str, str, Equation]]:
    """Names of equations, words on rows and differentiation, and one of the rows each."""
    rows: dict[tuple[str, str], list[int]] = {}
    first: dict[tuple[str, str], Equation] = {}
    for index, times in equations:
        equation = dae.reduced.equations[index]
        name, _, row = equation.name.partition(", row ")
        often = "" if times == 0 else ", differentiated " + ("once" if times == 1 else f"{times} times")
        first.setdefault((name, often), equation)
        rows.setdefault((name, often), []).extend([int(row)] if row else [])
    return [(key[0], _row_words(found) + key[1], first[key]) for key, found in rows.items()]


def _row_words(rows: list[int]) -> str:
    rows = sorted(set(rows))
    if not rows:
        return ""
    if len(rows) == 1:
        return f", row {rows[0]}"
    if len(rows) == 2 or rows != list(range(rows[0], rows[-1] + 1)):
        return f", rows {', '.join(str(r) for r in rows[:-1])} and {rows[-1]}"
    return f", rows {rows[0]} to {rows[-1]}"
