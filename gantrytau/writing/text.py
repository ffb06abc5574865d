"""The blocks of a Dae as plain text, in the order of solution, with the component equation each line comes from."""

from typing import TYPE_CHECKING

from gantrytau.writing.sections import Section, sections
from gantrytau.writing.sharing import written_at
from gantrytau.writing.syntax import CHOICE, SUM, Arguments, Written, infix

if TYPE_CHECKING:
    from gantrytau.dae import Dae

WORDS = {
    "or": " or ", "and": " and ", "not": "not ", "neg": "-",
    "<": " < ", "<=": " <= ", ">": " > ", ">=": " >= ", "==": " == ", "!=": " != ",
    "add": " + ", "sub": " - ", "mul": "*", "div": "/", "pow": "^",
}  # fmt: skip


def plain_number(value: float) -> str:
    """A number with as many digits as it needs; whole ones without a point."""
    whole = value == int(value) and abs(value) < 1e15 if abs(value) != float("inf") else False
    return str(int(value)) if whole else repr(float(value))


class PlainSyntax:
    """Names as in Python, powers with ^, functions by their usual names."""

    name = "plain text"

    def number(self, value: float) -> Written:
        """A number."""
        return Written(plain_number(value), SUM if value < 0 else 8, value < 0)

    def symbol(self, name: str) -> Written:
        """A name."""
        return Written(name)

    def shared(self, number: int) -> Written:
        """#1."""
        return Written(f"#{number}")

    def enclose(self, text: str) -> str:
        """(text)."""
        return f"({text})"

    def apply(self, operation: str, arguments: Arguments) -> Written | None:
        """Operators, `if c then a else b`, or a function call."""
        if operation == "select":
            text = f"if {arguments.bare(0)} then {arguments.bare(1)} else {arguments.bare(2)}"
            return Written(text, CHOICE)
        found = infix(arguments, operation, WORDS)
        if found is not None:
            return found
        return Written(f"{operation}({', '.join(arguments.bare(k) for k in range(len(arguments)))})")


def block_text(dae: "Dae") -> str:
    """One line per solved unknown, in the order of solution, with the component equation it comes from."""
    lines = [
        f"{dae.name}",
        f"known: {', '.join(dae.known) or 'nothing'}",
        f"states: {', '.join(dae.states) or 'none'}",
    ]
    lines += _events(dae)
    for section in sections(dae):
        lines += _section(section)
    return "\n".join(lines) + "\n"


def _events(dae: "Dae") -> list[str]:
    """What is set at instants."""
    lines = []
    for held in dae.flat.sampled:
        text = written_at(held.name, [held.expression, held.period], PlainSyntax())
        value, period = (e.text for e in text.expressions)
        where = [f"      with {name} = {expression}" for name, expression in text.definitions]
        lines += [
            f"sampled: {held.name} = {value}    # every {period} s, from {held.path or 'the model'}",
            *where,
        ]
    for force in dae.flat.frictions:
        text = written_at(force.force, [force.coulomb, force.smooth, force.breakaway], PlainSyntax())
        coulomb, smooth, breakaway = (e.text for e in text.expressions)
        where = [f"      with {name} = {expression}" for name, expression in text.definitions]
        lines += [
            f"stick-slip: {force.force} = sign({force.speed})*({coulomb}) + ({smooth}); at rest what holds "
            f"{force.speed} = 0, up to {breakaway}    # from {force.path or 'the model'}",
            *where,
        ]
    return lines


def _section(section: Section) -> list[str]:
    text = written_at(section.origin, (line.right for line in section.lines), PlainSyntax())
    where = [f"      with {name} = {expression}" for name, expression in text.definitions]
    if section.single:
        value = text.expressions[0].text
        return [
            f"[{section.number}] {section.lines[0].left} = {value}    # {section.kind}, from {section.origin}",
            *where,
        ]
    lines = [f"[{section.number}] {section.title}    # from {section.origin}", *where]
    for line, value in zip(section.lines, text.expressions, strict=True):
        note = f"    # determines {line.determines}" if line.determines else ""
        lines.append(f"      {line.left or '0'} = {value.text}{note}")
    return lines
