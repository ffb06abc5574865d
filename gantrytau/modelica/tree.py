"""The tree of a Modelica file: frozen records with the words of the specification, appendix A.

`at` is the offset in the text where the name of a thing stands, else where it begins; `SourceText.told` makes a place of it.
Trees are equal without regard to offsets. Names with dots are strings, texts of strings stay as they are written.
"""

from dataclasses import dataclass, field
from typing import ClassVar, TypeAlias, dataclass_transform

from gantrytau.modelica.source import SourceText


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
@dataclass(frozen=True)
class TreeNode:
    """A part of a tree. Its subclasses are frozen dataclasses; own: the fields beyond those that they inherit."""

    own: ClassVar[tuple[str, ...]] = ()
    at: int = field(compare=False, repr=False)

    def __init_subclass__(cls) -> None:
        cls.own = tuple(vars(cls).get("__annotations__", ()))
        dataclass(frozen=True)(cls)


class Expression(TreeNode):
    """What has a value."""


class Number(Expression):
    """An unsigned number as it is written."""

    text: str

    @property
    def value(self) -> int | float:
        """The number: an integer without point and exponent."""
        return int(self.text) if self.text.isdigit() else float(self.text)


class StringLiteral(Expression):
    """What stands between two quotes, escapes as they are written."""

    text: str


class BooleanLiteral(Expression):
    """`true` or `false`."""

    value: bool


class Mark(Expression):
    """A word that stands for a value: `end` and `:` in subscripts, `break` in modifications."""

    word: str


class ComponentReference(Expression):
    """Pairs of a name and its subscripts; the first name is "" after a leading dot."""

    parts: tuple[tuple[str, tuple[Expression, ...]], ...]


class Call(Expression):
    """Positional arguments, then named ones; or one argument with iterators. In Optimica also `x(t)` of a variable."""

    function: ComponentReference
    arguments: tuple[Expression, ...]
    named: tuple[tuple[str, Expression], ...]
    iterators: "tuple[Iterator, ...]"


class PartialCall(Expression):
    """`function f(a=1)` as an argument: a function with some of its inputs bound."""

    function: str
    named: tuple[tuple[str, Expression], ...]


class Unary(Expression):
    """A sign or `not` before an operand."""

    operator: str
    operand: Expression


class Binary(Expression):
    """An operator between two operands."""

    operator: str
    left: Expression
    right: Expression


class RangeExpression(Expression):
    """`start : stop` or `start : step : stop`."""

    start: Expression
    step: Expression | None
    stop: Expression


class Conditional(Expression):
    """`if c then a elseif d then b else e`: pairs of condition and value, and the last value."""

    branches: tuple[tuple[Expression, Expression], ...]
    otherwise: Expression


class ArrayConstructor(Expression):
    """`{a, b}`, or one element with iterators, `{a for i in 1:3}`."""

    items: tuple[Expression, ...]
    iterators: "tuple[Iterator, ...]"


class Matrix(Expression):
    """`[a, b; c, d]`, row by row."""

    rows: tuple[tuple[Expression, ...], ...]


class OutputList(Expression):
    """`(a, , c)`: several results of a function, of which some are left out."""

    items: tuple[Expression | None, ...]


class Subscripted(Expression):
    """`(a + b)[1]`."""

    array: Expression
    subscripts: tuple[Expression, ...]


Iterator: TypeAlias = tuple[str, Expression | None]


class Modification(TreeNode):
    """`(a=1) = value`; arguments are None without parentheses."""

    arguments: "tuple[AnyArgument, ...] | None"
    value: Expression | None


class Argument(TreeNode):
    """`each final name(...) = value "description"`; prefixes are of `each` and `final`."""

    prefixes: tuple[str, ...]
    name: str
    modification: Modification | None
    description: str | None


class Redeclaration(TreeNode):
    """`redeclare`, `replaceable` or both in a modification; the prefixes of the element say which."""

    each: bool
    element: "ComponentClause | ClassDefinition"


class Omission(TreeNode):
    """`break name` or `break connect(a, b)` in the modification of an `extends`."""

    left_out: "str | ConnectEquation"


AnyArgument: TypeAlias = Argument | Redeclaration | Omission
Annotation: TypeAlias = tuple[AnyArgument, ...] | None


class Described(TreeNode):
    """What has a description and an annotation; None where there is none."""

    description: str | None
    annotation: Annotation


class ComponentDeclaration(Described):
    """One component of a clause: `r[3](each unit="m") = zeros(3) if present "description"`."""

    name: str
    subscripts: tuple[Expression, ...]
    modification: Modification | None
    condition: Expression | None


class ConstrainedBy(Described):
    """`constrainedby Type(...)`."""

    type: str
    arguments: tuple[AnyArgument, ...] | None


class ComponentClause(TreeNode):
    """`parameter Type[3] a, b`; prefixes from `redeclare` to `output` in the order of the grammar."""

    prefixes: tuple[str, ...]
    type: str
    subscripts: tuple[Expression, ...]
    components: tuple[ComponentDeclaration, ...]
    constraint: ConstrainedBy | None


class ClassDefinition(Described):
    """A class: `kind` is one word, `model`; all before it, `partial` or `replaceable`, are prefixes."""

    prefixes: tuple[str, ...]
    kind: str
    name: str
    body: "Composition | ShortClass | Enumeration | DerivativeClass"
    constraint: ConstrainedBy | None


class Composition(TreeNode):
    """From the name to `end name`. extends: whether it is `class extends name(arguments)`.

    Optimica: an optimization has arguments as well, `(objective = ..., finalTime(free=true))`.
    """

    extends: bool
    arguments: tuple[AnyArgument, ...] | None
    sections: "tuple[ClassSection, ...]"
    external: "ExternalFunction | None"


class ClassSection(TreeNode):
    """A section; kind: "", "public", "protected", "equation", "initial equation", "algorithm", "constraint", ..."""

    kind: str
    items: "tuple[Element | EquationOrStatement, ...]"


class ExternalFunction(TreeNode):
    """`external "C" result = function(arguments) annotation(...)`; function is "" where none is given."""

    language: str | None
    result: ComponentReference | None
    function: str
    arguments: tuple[Expression, ...]
    annotation: Annotation


class ShortClass(TreeNode):
    """`= input Type[3](...)` of a short class."""

    prefixes: tuple[str, ...]
    type: str
    subscripts: tuple[Expression, ...]
    arguments: tuple[AnyArgument, ...] | None


class EnumerationLiteral(Described):
    """One value of an enumeration."""

    name: str


class Enumeration(TreeNode):
    """`= enumeration(a, b)`; None for `enumeration(:)`."""

    literals: tuple[EnumerationLiteral, ...] | None


class DerivativeClass(TreeNode):
    """`= der(f, x, y)`: the partial derivative of a function."""

    function: str
    inputs: tuple[str, ...]


class Import(Described):
    """`import alias = name`, or `import name.{names}`, where ("*",) stands for all names."""

    name: str
    alias: str | None
    names: tuple[str, ...] | None


class Extends(TreeNode):
    """`extends Type(...)`."""

    type: str
    arguments: tuple[AnyArgument, ...] | None
    annotation: Annotation


Element: TypeAlias = ClassDefinition | ComponentClause | Import | Extends


class SimpleEquation(Described):
    """`left = right`; in constraints of Optimica also `left <= right` and `left >= right`, by `relation`."""

    relation: str
    left: Expression
    right: Expression


class ConnectEquation(Described):
    """`connect(a, b)`."""

    a: ComponentReference
    b: ComponentReference


class ProcedureCall(Described):
    """A call as an equation or statement of its own: `assert`, `reinit`."""

    call: Call


class Assignment(Described):
    """`x := value`, or `(a, , b) := f(...)` where several is true."""

    several: bool
    targets: tuple[ComponentReference | None, ...]
    value: Expression


class Leave(Described):
    """`break` or `return`."""

    word: str


class Branching(Described):
    """An `if` or a `when` by `word`: pairs of a condition and what holds then; otherwise is None without `else`."""

    word: str
    branches: "tuple[tuple[Expression, tuple[EquationOrStatement, ...]], ...]"
    otherwise: "tuple[EquationOrStatement, ...] | None"


class ForLoop(Described):
    """`for i in 1:3, j loop`."""

    iterators: tuple[Iterator, ...]
    items: "tuple[EquationOrStatement, ...]"


class WhileLoop(Described):
    """`while condition loop`."""

    condition: Expression
    items: "tuple[EquationOrStatement, ...]"


EquationOrStatement: TypeAlias = (
    SimpleEquation | ConnectEquation | ProcedureCall | Assignment | Leave | Branching | ForLoop | WhileLoop
)


class StoredDefinition(TreeNode):
    """A file: `within` is None where it is not said, "" for the top; classes from the first to the last."""

    within: str | None
    classes: tuple[ClassDefinition, ...]
    source: SourceText = field(compare=False, repr=False)
