"""Expressions as lines of HTML that wrap, with MathML for what is taller than a line; names are links to their row.

Browsers break no line inside of a formula in MathML. So sums, products and names are text, which is broken before a sign,
and only quotients, roots and cases are MathML. Those that would be too wide for it are written on the line, with a stroke,
a power of one half or in words.
"""

import re
from collections.abc import Mapping
from html import escape

from gantrytau.language.symbols import split_derivative
from gantrytau.writing.names import name_of
from gantrytau.writing.syntax import ATOM, CHOICE, POWER, PRODUCT, SUM, Arguments, Written, infix
from gantrytau.writing.text import plain_number

NO_BREAK = "\u00a0"
JOINED = "\u2060"  # no line is broken here
SIGNS = {
    "or": "∨", "and": "∧", "<": "&lt;", "<=": "≤", ">": "&gt;", ">=": "≥", "==": "=", "!=": "≠", "add": "+", "sub": "−",
}  # fmt: skip
WORDS = {key: f" {sign}{NO_BREAK}" for key, sign in SIGNS.items()} | {"neg": "−", "not": "¬"}
FUNCTIONS = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "log": "ln", "sign": "sgn", "fmod": "mod"}
AROUND = {"abs": "||", "floor": "⌊⌋", "ceil": "⌈⌉"}
DOTS = {1: "\u0307", 2: "\u0308"}  # combining dots above
LOWERED = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
WIDEST = 60  # letters of what cannot be broken
ROOTS = 4 / 3  # of that where it is a root, which has no second line
CASES = (f"{JOINED}<math><mrow><mo>{{</mo><mtable>", f"</mtable></mrow></math>{JOINED}")
TAG = re.compile(r"<[^>]*>")


def html_name(name: str) -> str:
    """A name in HTML: the path as it is, Greek letters, indices below, derivatives as dots or as d/dt in front."""
    found = name_of(name)
    root = split_derivative(name).root
    path, dot, _ = ("", "", "") if "(" in root else root.rpartition(".")  # delay(x, 0.5)
    last, operator = found.parts[-1], ""
    dots = DOTS[found.order] if found.dotted else ""
    below = below_line(",".join(last.below)) if last.below else ""
    if found.order and not found.dotted:
        power = "" if found.order == 1 else f"<sup>{found.order}</sup>"
        operator = f"<b>d{power}/dt{power}</b>{NO_BREAK}"
    return f"{operator}{escape(path)}{dot}{escape(last.base)}{dots}{below}"


def below_line(text: str) -> str:
    """An index: digits as letters of their own, which are short, other texts as what stands below."""
    return text.translate(LOWERED) if text.isdecimal() and text.isascii() else f"<sub>{escape(text)}</sub>"


class FormulaSyntax:
    """Formulas for a page. anchors: where quantities stand in it, by name; inside: a component, whose path is left out;
    widest: letters of what cannot be broken.
    """

    name = "HTML"

    def __init__(self, anchors: Mapping[str, str], inside: str = "", widest: int = WIDEST):
        self._widest = widest
        self._anchors, self._prefix = anchors, f"{inside}." if inside else ""
        self._known: dict[str, Written] = {}

    def number(self, value: float) -> Written:
        """A number, with powers of ten."""
        sign = "−" if value < 0 else ""
        if abs(value) == float("inf"):
            return Written(f"{sign}∞", SUM if value < 0 else ATOM, value < 0)
        digits, _, exponent = plain_number(abs(value)).partition("e")
        text = sign + digits + (f"·10<sup>{int(exponent)}</sup>".replace("-", "−") if exponent else "")
        return Written(text, SUM if value < 0 else PRODUCT if exponent else ATOM, value < 0)

    def symbol(self, name: str) -> Written:
        """A name as a link."""
        if name not in self._known:
            self._known[name] = self._symbol(name)
        return self._known[name]

    def _symbol(self, name: str) -> Written:
        if name.startswith("pre("):  # just before an instant
            return Written(f"pre({self.symbol(name[4:-1]).text})")
        base, order = split_derivative(name)
        if base in self._anchors:
            short = base.removeprefix(self._prefix)
            foreign = short == base and f"{self._prefix}{base}" in self._anchors and self._prefix
            shown = "der(" * order + (f".{base}" if foreign else short) + ")" * order
            inside = f"<a href=#{self._anchors[base]}>{html_name(shown)}</a>"
        else:
            inside = f"<i>{html_name(name)}</i>" if "(" not in base else escape(name)
        found = name_of(name)
        return Written(inside, PRODUCT if found.order and not found.dotted else ATOM)

    def shared(self, number: int) -> Written:
        """The letter Sigma with a number."""
        return Written(f"Σ{below_line(str(number))}")

    def enclose(self, text: str) -> str:
        """(text), as tall as it has to be."""
        tall = "<math>" in text and width(text) <= self._widest
        return tower(f"<mrow><mo>(</mo>{token(text)}<mo>)</mo></mrow>") if tall else f"({text})"

    def apply(self, operation: str, arguments: Arguments) -> Written | None:
        """Fractions, powers, cases, or a function."""
        a, b = arguments.bare(0), arguments.bare(len(arguments) - 1)
        fits = all(width(arguments.bare(k)) <= self._widest for k in range(len(arguments)))
        if operation == "div":
            if fits:
                return Written(tower(f"<mfrac>{token(a)}{token(b)}</mfrac>"), PRODUCT)
            text = f"{arguments.held(0, PRODUCT)} /{NO_BREAK}{arguments.held(1, POWER)}"
            return Written(text, PRODUCT)
        if operation == "pow":
            return Written(f"{arguments.held(0, ATOM)}<sup>{b}</sup>", POWER)
        if operation == "sqrt":
            short = width(a) <= ROOTS * self._widest
            return Written(tower(f"<msqrt>{token(a)}</msqrt>") if short else f"√({a})")
        if operation == "mul":
            return Written(f"{arguments.held(0, PRODUCT)}·{arguments.held(1, PRODUCT)}", PRODUCT)
        if operation == "select":
            return _cases(arguments) if fits else _in_words(arguments)
        if operation in AROUND:
            opening, closing = AROUND[operation]
            return Written(f"{opening}{a}{closing}")
        found = infix(arguments, operation, WORDS)
        if found is not None:
            return found
        inside = ", ".join(arguments.bare(k) for k in range(len(arguments)))
        return Written(f"{FUNCTIONS.get(operation, operation)}{self.enclose(inside)}")


def width(text: str) -> int:
    """About how many letters are seen of it."""
    return len(TAG.sub("", text))


def token(text: str) -> str:
    """A line of HTML inside of MathML."""
    return f"<mtext><span>{text}</span></mtext>"


def tower(inside: str) -> str:
    """MathML in a line of HTML, which may be broken at spaces only."""
    return f"{JOINED}<math>{inside}</math>{JOINED}"


def _cases(arguments: Arguments) -> Written:
    """Cases, and those of a choice in the last of them, in one list."""
    condition, then, otherwise = (arguments.bare(k) for k in range(3))
    rest = otherwise.removeprefix(CASES[0]).removesuffix(CASES[1])
    if arguments.nodes[2].operation != "select" or rest == otherwise:
        rest = _case(otherwise, "otherwise")
    return Written(f"{CASES[0]}{_case(then, f'if {condition}')}{rest}{CASES[1]}", CHOICE)


def _case(value: str, words: str) -> str:
    return f"<mtr><mtd>{token(value)}</mtd><mtd>{token(words)}</mtd></mtr>"


def _in_words(arguments: Arguments) -> Written:
    condition, then, otherwise = (arguments.bare(k) for k in range(3))
    return Written(f"<b>if</b> {condition} <b>then</b> {then} <b>else</b> {otherwise}", CHOICE)
