"""The blocks of a Dae as plain text, in the order of solution, with the component equation each line comes from."""

from dataclasses import replace

from gantrytau.compiler.translated import Translated
from gantrytau.flattening.flat_model import FlatModel
from gantrytau.writing.excerpt import Excerpt, excerpt
from gantrytau.writing.instants_written import AtInstants, at_instants, line_written
from gantrytau.writing.sections import Section, section_text
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
    found = excerpt(dae)
    lines = [
        f"{dae.name}",
        f"known: {', '.join(found.known) or 'nothing'}",
        f"states: {', '.join(map(_state, found.states)) or 'none'}",
    ]
    if found.wanted:
        remarks = [(name, found.remark(scalars)) for name, scalars in found.asked]
        wanted = ", ".join(f"{name} ({remark})" if remark else name for name, remark in remarks)
        lines += [f"wanted: {wanted}", *filter(None, [found.left_out])]
    lines += [line for one in found.instants for line in _instant(one)]
    for section in found.sections:
        lines += _section(section)
    return "\n".join([*lines, *_answers(found)]) + "\n"


def _state(state: tuple[str, str]) -> str:
    """A state, and the symbol by which the equations know it."""
    name, symbol = state
    return name if name == symbol else f"{name} = {symbol}"


def friction_lines(flat: FlatModel) -> list[str]:
    """Friction that sticks, line by line."""
    return [
        line
        for one in at_instants(replace(flat, sampled=(), laws=(), whens=(), delays=()))
        for line in _instant(one)
    ]


def _instant(one: AtInstants) -> list[str]:
    """A statement on instants as a line, and lines with what its expressions share."""
    shared, words, note = line_written(one, PlainSyntax())
    where = [f"      with {name} = {expression}" for name, expression in shared]
    return [words + (f"    # {note}" if note else ""), *where]


def _answers(found: Excerpt) -> list[str]:
    """What the wanted names are that no block gives."""
    if not found.answers:
        return []
    names = [name for name, _ in found.answers]
    text = written_at(", ".join(names), [e for _, e in found.answers], PlainSyntax())
    lines = [f"      with {name} = {expression}" for name, expression in text.definitions]
    return ["so that", *lines] + [
        f"      {n} = {e.text}" for n, e in zip(names, text.expressions, strict=True)
    ]


def _section(section: Section) -> list[str]:
    text = section_text(section, PlainSyntax())
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
