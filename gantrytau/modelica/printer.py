"""A tree as Modelica text, which reads back as an equal tree."""

from collections.abc import Iterable, Iterator

from gantrytau.modelica import tree
from gantrytau.modelica.expressions import AND, OR, PRECEDENCE, RELATION, SUM, TERM
from gantrytau.modelica.tokens import spelled

OPERAND = 8  # above all operators


def written(file: tree.StoredDefinition) -> str:
    """The text of a tree; `parse` makes an equal tree of it."""
    lines = ["//! base 3.6.0"] if file.source.base else []
    lines += [] if file.within is None else [f"within {file.within};".replace(" ;", ";")]
    for one in file.classes:
        lines += [*_class(one), ""]
    return "\n".join(lines)


def expression_written(e: tree.Expression, least: int = -1) -> str:
    """An expression, in parentheses where it binds less than `least`."""
    text, binds = _expression(e)
    return text if binds >= least else f"({text})"


def _expression(e: tree.Expression) -> tuple[str, int]:
    """The text of an expression and how strongly its outermost operator binds."""
    write = expression_written
    if isinstance(e, tree.ComponentReference):
        return ".".join(spelled(name) + _subscripts(subscripts) for name, subscripts in e.parts), OPERAND
    if isinstance(e, tree.Number):
        return e.text, OPERAND
    if isinstance(e, tree.Binary):
        level, behind = PRECEDENCE[e.operator], []
        chains = level in (OR, AND, SUM, TERM)  # but not a < b and a ^ b
        while True:  # a sum of a thousand terms is as deep
            behind.append(f" {e.operator} {write(e.right, level + 1)}")
            if not (chains and isinstance(e.left, tree.Binary) and PRECEDENCE[e.left.operator] == level):
                return "".join((write(e.left, level + (not chains)), *reversed(behind))), level
            e = e.left
    if isinstance(e, tree.Unary):
        if e.operator == "not":
            return f"not {write(e.operand, RELATION)}", RELATION - 1
        return f"{e.operator}{write(e.operand, TERM)}", SUM
    if isinstance(e, tree.Conditional):
        pairs = (f"if {write(condition)} then {write(value)}" for condition, value in e.branches)
        return f"{' else'.join(pairs)} else {write(e.otherwise)}", -1
    if isinstance(e, tree.RangeExpression):
        parts = [part for part in (e.start, e.step, e.stop) if part is not None]
        return ":".join(write(part, 1) for part in parts), 0
    return _operand(e), OPERAND


def _operand(e: tree.Expression) -> str:
    """An expression that has its own brackets, or is a literal."""
    match e:
        case tree.StringLiteral():
            return f'"{e.text}"'
        case tree.BooleanLiteral():
            return "true" if e.value else "false"
        case tree.Mark():
            return e.word
        case tree.Call():
            return f"{expression_written(e.function)}({_inside(e.arguments, e.named, e.iterators)})"
        case tree.PartialCall():
            return f"function {e.function}({_inside((), e.named, ())})"
        case tree.ArrayConstructor():
            return f"{{{_inside(e.items, (), e.iterators)}}}"
        case tree.Matrix():
            return f"[{'; '.join(_inside(row, (), ()) for row in e.rows)}]"
        case tree.OutputList():
            return f"({', '.join('' if item is None else expression_written(item) for item in e.items)})"
        case tree.Subscripted():
            array = expression_written(e.array)
            return (array if isinstance(e.array, tree.OutputList) else f"({array})") + _subscripts(
                e.subscripts
            )
        case _:
            raise AssertionError(e)


def _inside(
    arguments: Iterable[tree.Expression],
    named: Iterable[tuple[str, tree.Expression]],
    iterators: tuple[tree.Iterator, ...],
) -> str:
    """What stands between the brackets of a call or an array."""
    texts = [expression_written(one) for one in arguments]
    texts += [f"{spelled(name)} = {expression_written(value)}" for name, value in named]
    return ", ".join(texts) + (f" {_iterators(iterators)}" if iterators else "")


def _iterators(iterators: tuple[tree.Iterator, ...]) -> str:
    """`for i in 1:3, j`."""
    return "for " + ", ".join(
        name if over is None else f"{name} in {expression_written(over)}" for name, over in iterators
    )


def _subscripts(subscripts: tuple[tree.Expression, ...]) -> str:
    """`[1, :]`, or nothing."""
    return f"[{_inside(subscripts, (), ())}]" if subscripts else ""


def _arguments(arguments: tuple[tree.AnyArgument, ...] | None) -> str:
    """`(a = 1, redeclare B c)`, or nothing."""
    return "" if arguments is None else f"({', '.join(map(_argument, arguments))})"


def _argument(argument: tree.AnyArgument) -> str:
    """One argument of a modification."""
    if isinstance(argument, tree.Omission):
        left_out = argument.left_out
        return f"break {left_out if isinstance(left_out, str) else _connect(left_out)}"
    if isinstance(argument, tree.Argument):
        name = ".".join(map(spelled, argument.name.split(".")))
        words = [*argument.prefixes, name + _modification(argument.modification)]
        return " ".join(words) + _description(argument.description)
    element = argument.element
    redeclare = element.prefixes[:1] == ("redeclare",)
    each = ("each",) if argument.each else ()
    before = (*element.prefixes[:redeclare], *each, *element.prefixes[redeclare:])
    if isinstance(element, tree.ComponentClause):
        return _clause(element, before)
    return "\n".join(_class(element, before)).removesuffix(";")


def _modification(modification: tree.Modification | None) -> str:
    """`(...) = value`."""
    if modification is None:
        return ""
    value = "" if modification.value is None else f" = {expression_written(modification.value)}"
    return _arguments(modification.arguments) + value


def _description(text: str | None) -> str:
    """A description behind a blank."""
    return "" if text is None else f' "{text}"'


def _annotation(annotation: tree.Annotation) -> str:
    """An annotation behind a blank."""
    return "" if annotation is None else f" annotation{_arguments(annotation)}"


def _about(thing: tree.Described) -> str:
    """Description and annotation."""
    return _description(thing.description) + _annotation(thing.annotation)


def _constraint(constraint: tree.ConstrainedBy | None) -> str:
    """`constrainedby Type(...)` behind a blank."""
    if constraint is None:
        return ""
    return f" constrainedby {constraint.type}{_arguments(constraint.arguments)}{_about(constraint)}"


def _clause(clause: tree.ComponentClause, prefixes: tuple[str, ...]) -> str:
    """A type and its components, without a semicolon."""
    words = " ".join((*prefixes, clause.type + _subscripts(clause.subscripts)))
    return f"{words} {', '.join(map(_component, clause.components))}{_constraint(clause.constraint)}"


def _component(one: tree.ComponentDeclaration) -> str:
    """A component with its modification, condition and description."""
    condition = "" if one.condition is None else f" if {expression_written(one.condition)}"
    return (
        spelled(one.name)
        + _subscripts(one.subscripts)
        + _modification(one.modification)
        + condition
        + _about(one)
    )


def _class(one: tree.ClassDefinition, prefixes: tuple[str, ...] | None = None) -> Iterator[str]:
    """The lines of a class."""
    words = " ".join((*(one.prefixes if prefixes is None else prefixes), one.kind))
    body, tail = one.body, f"{_constraint(one.constraint)};"
    if isinstance(body, tree.Composition):
        extends = "extends " if body.extends else ""
        yield f"{words} {extends}{spelled(one.name)}{_arguments(body.arguments)}{_description(one.description)}"
        yield from _composition(body)
        if one.annotation is not None:
            yield f" {_annotation(one.annotation)};"
        yield f"end {spelled(one.name)}{tail}"
        return
    if isinstance(body, tree.ShortClass):
        what = " ".join((*body.prefixes, body.type + _subscripts(body.subscripts))) + _arguments(
            body.arguments
        )
    elif isinstance(body, tree.DerivativeClass):
        what = f"der({', '.join((body.function, *body.inputs))})"
    else:
        what = f"enumeration({_literals(body)})"
    yield f"{words} {spelled(one.name)} = {what}{_about(one)}{tail}"


def _literals(body: tree.Enumeration) -> str:
    """The values of an enumeration."""
    if body.literals is None:
        return ":"
    return ", ".join(spelled(one.name) + _about(one) for one in body.literals)


def _composition(body: tree.Composition) -> Iterator[str]:
    """The lines of the sections."""
    for section in body.sections:
        if section.kind:
            yield section.kind
        for item in section.items:
            yield from _indented(_item(item))
    if body.external is not None:
        yield f"  {_external(body.external)}"


def _external(external: tree.ExternalFunction) -> str:
    """`external "C" y = f(x);`."""
    words = "external" + _description(external.language)
    if external.result is not None:
        words += f" {expression_written(external.result)} ="
    if external.function:
        words += f" {external.function}({_inside(external.arguments, (), ())})"
    return f"{words}{_annotation(external.annotation)};"


def _indented(lines: Iterable[str]) -> Iterator[str]:
    """Lines moved to the right; what goes on in strings stays where it is."""
    return (f"  {line}" for line in lines)


def _connect(equation: tree.ConnectEquation) -> str:
    """`connect(a, b)`."""
    return f"connect({expression_written(equation.a)}, {expression_written(equation.b)})"


def _item(item: tree.Element | tree.EquationOrStatement) -> Iterable[str]:
    """The lines of an element, an equation or a statement."""
    match item:
        case tree.ClassDefinition():
            return _class(item)
        case tree.ComponentClause():
            return [f"{_clause(item, item.prefixes)};"]
        case tree.Import():
            alias = "" if item.alias is None else f"{item.alias} = "
            names = "" if item.names is None else f".{{{', '.join(item.names)}}}"
            names = ".*" if item.names == ("*",) else names
            return [f"import {alias}{item.name}{names}{_about(item)};"]
        case tree.Extends():
            return [f"extends {item.type}{_arguments(item.arguments)}{_annotation(item.annotation)};"]
        case tree.SimpleEquation():
            least = SUM if item.relation != "=" else 1
            sides = f"{expression_written(item.left, least)} {item.relation} {expression_written(item.right)}"
            return [f"{sides}{_about(item)};"]
        case tree.ConnectEquation():
            return [f"{_connect(item)}{_about(item)};"]
        case tree.ProcedureCall():
            return [f"{expression_written(item.call)}{_about(item)};"]
        case tree.Assignment():
            targets = ", ".join("" if one is None else expression_written(one) for one in item.targets)
            left = f"({targets})" if item.several else targets
            return [f"{left} := {expression_written(item.value)}{_about(item)};"]
        case tree.Leave():
            return [f"{item.word}{_about(item)};"]
        case tree.Branching() | tree.ForLoop() | tree.WhileLoop():
            return _block(item)


def _block(block: tree.Branching | tree.ForLoop | tree.WhileLoop) -> Iterator[str]:
    """The lines of a block with others in it."""
    if isinstance(block, tree.Branching):
        word = block.word
        for k, (condition, items) in enumerate(block.branches):
            yield f"{'else' * (k > 0)}{word} {expression_written(condition)} then"
            for item in items:
                yield from _indented(_item(item))
        if block.otherwise is not None:
            yield "else"
        inside = block.otherwise or ()
    elif isinstance(block, tree.ForLoop):
        word, inside = "for", block.items
        yield f"{_iterators(block.iterators)} loop"
    else:
        word, inside = "while", block.items
        yield f"while {expression_written(block.condition)} loop"
    for item in inside:
        yield from _indented(_item(item))
    yield f"end {word}{_about(block)};"
