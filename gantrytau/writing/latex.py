r"""The blocks of a Dae as a LaTeX fragment: one align environment for each, under the equations it comes from.

The fragment is included in a document with \usepackage{amsmath}; it defines nothing.
"""

import re

from gantrytau.compiler.translated import Translated
from gantrytau.writing.excerpt import Excerpt, excerpt
from gantrytau.writing.instants_written import AtInstants, line_written
from gantrytau.writing.names import GREEK, Name, name_of
from gantrytau.writing.sections import Section, section_text
from gantrytau.writing.subexpressions import written_at
from gantrytau.writing.syntax import ATOM, CHOICE, POWER, PRODUCT, SUM, Arguments, Written, infix
from gantrytau.writing.text import plain_number

WORDS = {
    "or": r" \lor ", "and": r" \land ", "not": r"\lnot ", "neg": "-",
    "<": " < ", "<=": r" \le ", ">": " > ", ">=": r" \ge ", "==": " = ", "!=": r" \ne ",
    "add": " + ", "sub": " - ",
}  # fmt: skip
FUNCTIONS = {
    **{n: "\\" + n for n in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "min", "max")},
    "log": r"\ln", "asin": r"\arcsin", "acos": r"\arccos", "atan": r"\arctan",
    **{n: rf"\operatorname{{{n}}}" for n in ("atan2", "erf", "copysign", "remainder", "hypot")},
    "sign": r"\operatorname{sgn}", "fmod": r"\operatorname{mod}", "erfinv": r"\operatorname{erf}^{-1}",
    "asinh": r"\operatorname{arsinh}", "acosh": r"\operatorname{arcosh}", "atanh": r"\operatorname{artanh}",
    "log1p": r"\operatorname{log1p}", "expm1": r"\operatorname{expm1}",
}  # fmt: skip
AROUND = {
    "abs": (r"\left|", r"\right|"),
    "floor": (r"\lfloor ", r" \rfloor"),
    "ceil": (r"\lceil ", r" \rceil"),
}
LETTERS = {letter: "\\" + word for word, letter in GREEK.items() if word not in ("w", "th", "lambda_")} | {
    "φ": r"\varphi"
}
SPECIAL = {
    "\\": r"\textbackslash{}", "_": r"\_", "{": r"\{", "}": r"\}", "#": r"\#", "$": r"\$", "%": r"\%", "&": r"\&",
    "^": r"\textasciicircum{}", "~": r"\textasciitilde{}",
}  # fmt: skip
WIDEST = 60  # letters of a line before its sum is broken, about the width of a page
COMMANDS = re.compile(r"\\[a-z]+|[{}_^\\ ]")


def escaped(text: str) -> str:
    """Text with LaTeX's special characters made harmless."""
    return "".join(SPECIAL.get(c, c) for c in text)


class LatexSyntax:
    """Fractions, roots, cases; names with subscripts, Greek letters and dots."""

    name = "LaTeX"

    def number(self, value: float) -> Written:
        """A number, with powers of ten."""
        if abs(value) == float("inf"):
            return Written(r"\infty" if value > 0 else r"-\infty", ATOM if value > 0 else SUM, value < 0)
        digits, _, exponent = plain_number(value).partition("e")
        if exponent:
            return Written(
                rf"{digits} \cdot 10^{{{int(exponent)}}}", SUM if value < 0 else PRODUCT, value < 0
            )
        return Written(digits, SUM if value < 0 else ATOM, value < 0)

    def symbol(self, name: str) -> Written:
        """A name with its derivative; pre() of it just before an instant."""
        if name.startswith("pre("):
            return Written(rf"\operatorname{{pre}}{self.enclose(self.symbol(name[4:-1]).text)}")
        found = name_of(name)
        return Written(latex_name(found), PRODUCT if found.order and not found.dotted else ATOM)

    def shared(self, number: int) -> Written:
        """The letter Sigma with a number."""
        return Written(rf"\Sigma_{{{number}}}")

    def enclose(self, text: str) -> str:
        """(text), as tall as it has to be."""
        return rf"\left({text}\right)"

    def apply(self, operation: str, arguments: Arguments) -> Written | None:
        """Fractions, powers, cases, or a function."""
        a, b = arguments.bare(0), arguments.bare(len(arguments) - 1)
        if operation == "div":
            # a fraction can stand in a product, but not be the base of a power
            return Written(rf"\frac{{{a}}}{{{b}}}", PRODUCT)
        if operation == "pow":
            return Written(f"{arguments.held(0, ATOM)}^{{{b}}}", POWER)
        if operation == "sqrt":
            return Written(rf"\sqrt{{{a}}}")
        if operation == "mul":
            return self._product(arguments)
        if operation == "select":
            return Written(_cases(arguments), CHOICE)
        if operation in AROUND:
            opening, closing = AROUND[operation]
            return Written(f"{opening}{a}{closing}")
        if operation in FUNCTIONS:
            inside = ", ".join(arguments.bare(k) for k in range(len(arguments)))
            return Written(FUNCTIONS[operation] + self.enclose(inside))
        return infix(arguments, operation, WORDS)

    def _product(self, arguments: Arguments) -> Written:
        left, right = arguments.held(0, PRODUCT), arguments.held(1, PRODUCT)
        dot = r" \cdot " if right[0].isdigit() else r" \, "
        return Written(left + dot + right, PRODUCT)


def _cases(arguments: Arguments) -> str:
    """Cases, and those of a choice in the last of them, in one list."""
    condition, then, otherwise = (arguments.bare(k) for k in range(3))
    opening, closing = r"\begin{cases} ", r" \end{cases}"
    if arguments.nodes[2].operation == "select" and otherwise.startswith(opening):
        rest = otherwise.removeprefix(opening).removesuffix(closing)
    else:
        rest = rf"{otherwise} & \text{{otherwise}}"
    return rf"{opening}{then} & \text{{if }} {condition} \\ {rest}{closing}"


def latex_name(name: Name) -> str:
    """A dotted name; the derivative as dots over a letter, else as an operator in front."""
    texts = []
    for place, part in enumerate(name.parts):
        base = LETTERS.get(part.base, part.base) if part.letter else rf"\mathit{{{escaped(part.base)}}}"
        if name.dotted and place == len(name.parts) - 1:
            base = rf"\{'d' * name.order}ot{{{base}}}"
        below = ",".join(b if len(b) == 1 or b.isdigit() else rf"\mathit{{{escaped(b)}}}" for b in part.below)
        texts.append(base + (f"_{{{below}}}" if below else ""))
    text = ".".join(texts)
    if name.order and not name.dotted:
        power = "" if name.order == 1 else f"^{{{name.order}}}"
        text = rf"\frac{{\mathrm{{d}}{power}}}{{\mathrm{{d}}t{power}}} {text}"
    return text


def latex_text(dae: Translated) -> str:
    """A LaTeX fragment: what is known, the states, and every block with its origin, or those that what is wanted needs."""
    found, syntax = excerpt(dae), LatexSyntax()
    lines = [f"% Equations of {dae.name} in the order of their solution; needs \\usepackage{{amsmath}}."]
    lines += [rf"\section*{{Equations of {escaped(dae.name)}}}"]
    states = [name if name == symbol else f"{name} = {symbol}" for name, symbol in found.states]
    rows = [
        ("Known", found.known),
        ("States", states),
        *([("Wanted", [n for n, _ in found.asked])] if found.asked else []),
    ]
    for words, names in rows:
        spoken = ", ".join(f"${' = '.join(syntax.symbol(x).text for x in n.split(' = '))}$" for n in names)
        lines.append(rf"\noindent {words}: {spoken or 'none'}.\par")
    for one in found.instants:
        lines += _instant(one)
    for section in found.sections:
        lines += ["", *_section(section)]
    return "\n".join([*lines, *_answers(found)]) + "\n"


def _instant(one: AtInstants) -> list[str]:
    """A statement on instants as a sentence, and what its expressions share."""
    shared, words, note = line_written(one, LatexSyntax(), escaped, "${}$")
    where = "".join(f", ${name} = {expression}$" for name, expression in shared)
    return [rf"\noindent {words}{where}{f' ({note})' if note else ''}\par"]


def _answers(found: Excerpt) -> list[str]:
    """What the wanted names are that no block gives."""
    if not found.answers:
        return []
    names, syntax = [name for name, _ in found.answers], LatexSyntax()
    text = written_at(", ".join(names), [e for _, e in found.answers], syntax)
    rows = [f"{name} &= {_broken(expression)}" for name, expression in text.definitions]
    rows += [
        f"{syntax.symbol(n).text} &= {_broken(e.text)}" for n, e in zip(names, text.expressions, strict=True)
    ]
    return ["", r"\noindent so that", r"\begin{align*}", " \\\\\n".join(rows), r"\end{align*}"]


def _section(section: Section) -> list[str]:
    syntax = LatexSyntax()
    text = section_text(section, syntax)
    rows = [f"{name} &= {_broken(expression)}" for name, expression in text.definitions]
    for line, value in zip(section.lines, text.expressions, strict=True):
        left = "0" if line.left is None else syntax.symbol(line.left).text
        rows.append(f"{left} &= {_broken(value.text)}")
    head = rf"\paragraph{{Block {section.number}}} {escaped(section.title)}, from {escaped(section.origin)}."
    return [head, r"\begin{align*}", " \\\\\n".join(rows), r"\end{align*}"]


def _broken(text: str) -> str:
    """A long sum over several lines, broken before a sign that stands outside of all braces."""
    pieces, depth, start = [], 0, 0
    for place, letter in enumerate(text):
        depth += (letter in "{(") - (letter in "})")
        outside = depth == 0 and text.startswith((" + ", " - "), place)
        if outside and r"\begin" not in text[start:place] and _width(text[start:place]) > WIDEST:
            pieces.append(text[start:place])
            start = place
    return " \\\\\n&\\quad{}".join([*pieces, text[start:]])


def _width(text: str) -> int:
    """About how many letters are seen of it."""
    return len(COMMANDS.sub("", text))
