"""The blocks of a Dae as plain text, in the order of solution, with the component equation each line comes from."""

import casadi as ca

from gantrytau.compiler.translated import Translated
from gantrytau.writing.sections import Section, sections
from gantrytau.writing.subexpressions import written_at
from gantrytau.writing.syntax import CHOICE, SUM, Arguments, Written, infix

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


def block_text(dae: Translated) -> str:
    """One line per solved unknown, in the order of solution, with the component equation it comes from."""
    lines = [
        f"{dae.name}",
        f"known: {', '.join(dae.known) or 'nothing'}",
        f"states: {', '.join(dae.states) or 'none'}",
    ]
    lines += event_lines(dae)
    for section in sections(dae):
        lines += _section(section)
    return "\n".join(lines) + "\n"


def event_lines(dae: Translated) -> list[str]:
    """What is set at instants, line by line."""
    lines = []
    for held in dae.flat.sampled:
        place = held.path or "the model"
        (value, period), where = _written_out(held.name, [held.expression, held.period])
        lines += [f"sampled: {held.name} = {value}    # every {period} s, from {place}", *where]
    for friction in dae.flat.frictions:
        place, force, speed = friction.path or "the model", friction.force, friction.speed
        parts = [friction.coulomb, friction.smooth, friction.breakaway]
        (coulomb, smooth, breakaway), where = _written_out(force, parts)
        law = f"sign({speed})*({coulomb}) + {smooth}"
        lines.append(
            f"friction: {force} = {law}; at rest as {speed} = 0 needs, up to {breakaway}    # from {place}"
        )
        lines += where
    for one in dae.flat.whens:
        place, names = one.path or "the model", [n for n, _ in (*one.reinits, *one.assignments)]
        values = [e for _, e in (*one.reinits, *one.assignments)]
        (condition, *texts), where = _written_out(one.label, [one.condition, *values])
        done = [f"{n} := {value}" for n, value in zip(names, texts, strict=True)]
        done += [f"terminate: {one.message}"] if one.message else []
        word = "when" if one.after < 0 else "elsewhen"
        holds = condition.removeprefix("if ").removesuffix(" then 1 else 0")  # as a number it is written
        lines += [f"{word} {holds}: {', '.join(done)}    # from {place}", *where]
    return lines


def _written_out(place: str, expressions: list[ca.SX]) -> tuple[list[str], list[str]]:
    """Expressions as texts, and lines with what they share."""
    text = written_at(place, expressions, PlainSyntax())
    where = [f"      with {name} = {expression}" for name, expression in text.definitions]
    return [e.text for e in text.expressions], where


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
