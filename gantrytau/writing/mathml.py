"""Expressions in MathML Core, which browsers draw themselves; names are links to the table of variables."""

from collections.abc import Mapping
from html import escape

from gantrytau.writing.names import name_of
from gantrytau.writing.syntax import ATOM, CHOICE, POWER, PRODUCT, SUM, Arguments, Written, infix
from gantrytau.writing.text import plain_number

SIGNS = {
    "or": " ∨ ", "and": " ∧ ", "not": "¬", "neg": "−", "<": "<", "<=": "≤", ">": ">", ">=": "≥", "==": "=",
    "!=": "≠", "add": "+", "sub": "−",
}  # fmt: skip
WORDS = {key: f"<mo>{escape(sign)}</mo>" for key, sign in SIGNS.items()}
FUNCTIONS = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "log": "ln", "sign": "sgn", "fmod": "mod"}
AROUND = {"abs": "||", "floor": "⌊⌋", "ceil": "⌈⌉"}
DOTS = {1: "\u0307", 2: "\u0308"}  # combining dots above


def html_name(name: str) -> str:
    """A name in HTML: italics, indices below, derivatives as dots or as d/dt in front."""
    found = name_of(name)
    texts = []
    for place, part in enumerate(found.parts):
        dots = DOTS[found.order] if found.dotted and place == len(found.parts) - 1 else ""
        below = f"<sub>{escape(','.join(part.below))}</sub>" if part.below else ""
        texts.append(f"<i>{escape(part.base)}{dots}</i>{below}")
    operator = ""
    if found.order and not found.dotted:
        power = "" if found.order == 1 else f"<sup>{found.order}</sup>"
        operator = f"d{power}/dt{power} "
    return operator + ".".join(texts)


class MathSyntax:
    """Fractions, roots and cases; `titles` explains a name, `anchors` says where it is declared."""

    name = "MathML"

    def __init__(self, titles: Mapping[str, str], anchors: Mapping[str, str]):
        self._titles, self._anchors = titles, anchors

    def number(self, value: float) -> Written:
        """A number, with powers of ten."""
        sign = "<mo>−</mo>" if value < 0 else ""
        if abs(value) == float("inf"):
            return Written(f"{sign}<mi>∞</mi>", SUM if value < 0 else ATOM, value < 0)
        digits, _, exponent = plain_number(abs(value)).partition("e")
        text = f"{sign}<mn>{digits}</mn>"
        if exponent:
            text += f"<mo>·</mo><msup><mn>10</mn><mn>{int(exponent)}</mn></msup>"
        return Written(text, SUM if value < 0 else PRODUCT if exponent else ATOM, value < 0)

    def symbol(self, name: str) -> Written:
        """A name as a link that explains itself."""
        title = escape(self._titles.get(name, ""))
        anchor = self._anchors.get(name)
        inside = html_name(name)
        if anchor:
            inside = f'<a href="#{anchor}" title="{title}">{inside}</a>'
        found = name_of(name)
        return Written(f"<mtext>{inside}</mtext>", PRODUCT if found.order and not found.dotted else ATOM)

    def shared(self, number: int) -> Written:
        """The letter Sigma with a number."""
        return Written(f"<msub><mi>Σ</mi><mn>{number}</mn></msub>")

    def enclose(self, text: str) -> str:
        """(text)."""
        return f"<mrow><mo>(</mo>{text}<mo>)</mo></mrow>"

    def apply(self, operation: str, arguments: Arguments) -> Written | None:
        """Fractions, powers, cases, or a function."""
        a, b = arguments.bare(0), arguments.bare(len(arguments) - 1)
        if operation == "div":
            return Written(f"<mfrac><mrow>{a}</mrow><mrow>{b}</mrow></mfrac>", PRODUCT)
        if operation == "pow":
            return Written(f"<msup><mrow>{arguments.held(0, ATOM)}</mrow><mrow>{b}</mrow></msup>", POWER)
        if operation == "sqrt":
            return Written(f"<msqrt>{a}</msqrt>")
        if operation == "mul":
            left, right = arguments.held(0, PRODUCT), arguments.held(1, PRODUCT)
            return Written(f"{left}<mo>·</mo>{right}", PRODUCT)
        if operation == "select":
            return Written(_cases(arguments), CHOICE)
        if operation in AROUND:
            opening, closing = AROUND[operation]
            return Written(f"<mrow><mo>{opening}</mo>{a}<mo>{closing}</mo></mrow>")
        found = infix(arguments, operation, WORDS)
        if found is not None:
            return found
        inside = "<mo>,</mo>".join(arguments.bare(k) for k in range(len(arguments)))
        return Written(f"<mi>{FUNCTIONS.get(operation, operation)}</mi>{self.enclose(inside)}")


def _cases(arguments: Arguments) -> str:
    condition, then, otherwise = (arguments.bare(k) for k in range(3))
    rows = ((then, f"<mtext>if </mtext>{condition}"), (otherwise, "<mtext>otherwise</mtext>"))
    table = "".join(f"<mtr><mtd>{value}</mtd><mtd>{words}</mtd></mtr>" for value, words in rows)
    return f"<mrow><mo>{{</mo><mtable>{table}</mtable></mrow>"


def equality(left: str, right: str) -> str:
    """An equation on a line of its own."""
    return f'<math display="block"><mrow>{left}<mo>=</mo>{right}</mrow></math>'
