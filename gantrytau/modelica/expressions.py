"""Expressions, by descent: what stands between operators, and operators by their precedence."""

from gantrytau.modelica import tree
from gantrytau.modelica.tokens import Tokens

OR, AND, NOT, RELATION, SUM, TERM, POWER = 1, 2, 3, 4, 5, 6, 7
PRECEDENCE = {
    "or": OR,
    "and": AND,
    **dict.fromkeys(("<", "<=", ">", ">=", "==", "<>"), RELATION),
    **dict.fromkeys(("+", "-", ".+", ".-"), SUM),
    **dict.fromkeys(("*", "/", ".*", "./"), TERM),
    **dict.fromkeys(("^", ".^"), POWER),
}
SIGNS = frozenset({"+", "-", ".+", ".-"})
AFTER_NAMED = "',' and a named argument, or ')'"
NAMES = frozenset({"name", "der", "initial", "pure", "."})  # a reference or a call begins with these


class ExpressionReader(Tokens):
    """Reads expressions; a method for each production of the grammar, called as it is there."""

    def expression(self) -> tree.Expression:
        """A conditional, a range, or a simple expression."""
        if self.kind == "if":
            return self.conditional()
        at, first = self.at, self.simple_expression()
        if self.kind != ":":
            return first
        self.advance()
        second = self.simple_expression()
        if not self.take(":"):
            return tree.RangeExpression(at, first, None, second)
        return tree.RangeExpression(at, first, second, self.simple_expression())

    def conditional(self) -> tree.Conditional:
        """`if a then b elseif c then d else e`."""
        at, branches = self.at, []
        while not branches or self.kind == "elseif":
            self.advance()
            condition = self.expression()
            self.expect("then")
            branches.append((condition, self.expression()))
        self.expect("else")
        return tree.Conditional(at, tuple(branches), self.expression())

    def simple_expression(self, least: int = 1) -> tree.Expression:
        """Operands and operators of at least this precedence."""
        at, kind = self.at, self.kind
        if kind in SIGNS:  # takes a term: -a * b is -(a * b); behind * and ^ the nearest operand only
            self.advance()
            left: tree.Expression = tree.Unary(at, kind, self.simple_expression(max(least, TERM)))
        elif kind == "not" and least <= NOT:
            self.advance()
            left = tree.Unary(at, kind, self.simple_expression(RELATION))
        else:
            left = self.primary()
        most = POWER
        while least <= (level := PRECEDENCE.get(self.kind, 0)) <= most:
            operator = self.advance()
            left = tree.Binary(at, operator, left, self.simple_expression(level + 1))
            if level in (RELATION, POWER):  # a < b < c and a ^ b ^ c are none
                most = level - 1
        return left

    def primary(self) -> tree.Expression:
        """An operand."""
        at, kind = self.at, self.kind
        if kind in NAMES:
            name = self.component_reference()
            return self.call(name) if self.kind == "(" else name
        if kind == "number":
            return tree.Number(at, self.advance())
        if kind == "string":
            return tree.StringLiteral(at, self.advance())
        if kind in ("true", "false"):
            return tree.BooleanLiteral(at, self.advance() == "true")
        if kind == "(":
            return self.parentheses()
        if kind == "{":
            self.advance()
            if self.kind == "}":
                self.refuse("an expression; an empty array is written fill(0, 0)")
            items = self.listed(self.argument)
            iterators = self.for_indices() if self.kind == "for" and len(items) == 1 else ()
            self.expect("}")
            return tree.ArrayConstructor(at, items, iterators)
        if kind == "[":
            self.advance()
            rows = self.listed(self.expression_list, ";")
            self.expect("]")
            return tree.Matrix(at, rows)
        if kind == "end" and self.subscripts:
            return tree.Mark(at, self.advance())
        return self.refuse("an expression")

    def component_reference(self) -> tree.ComponentReference:
        """`.a.b[1].c`, or `der`, `initial`, `pure` before their parentheses."""
        at, parts = self.at, []
        if self.kind in ("der", "initial", "pure"):
            if self.next_kind != "(":
                word = self.advance()
                self.refuse(f"'(' behind the keyword '{word}'")
            return tree.ComponentReference(at, ((self.advance(), ()),))
        if self.take("."):
            parts.append(("", ()))
        while True:
            name = self.expect("name")
            parts.append((name, self.array_subscripts() if self.kind == "[" else ()))
            if self.kind != ".":
                return tree.ComponentReference(at, tuple(parts))
            self.advance()

    def array_subscripts(self) -> tuple[tree.Expression, ...]:
        """`[1, :, end]`; nothing where no bracket opens."""
        if not self.take("["):
            return ()
        self.subscripts += 1
        items = self.listed(self.subscript)
        self.subscripts -= 1
        self.expect("]")
        return items

    def subscript(self) -> tree.Expression:
        """An expression, or `:` for all indices."""
        at = self.at
        return tree.Mark(at, ":") if self.take(":") else self.expression()

    def call(self, function: tree.ComponentReference) -> tree.Call:
        """The arguments of a call, in parentheses."""
        self.expect("(")
        arguments: list[tree.Expression] = []
        named: tuple[tuple[str, tree.Expression], ...] = ()
        iterators: tuple[tree.Iterator, ...] = ()
        while self.kind != ")":
            if self.kind == "name" and self.next_kind == "=":
                named = self.listed(self.named_argument)
                break
            arguments.append(self.argument())
            if self.kind == "for" and len(arguments) == 1:
                iterators = self.for_indices()
                break
            if not self.take(","):
                break
            if self.kind == ")":
                self.refuse("an argument")
        self.expect(")", "')'" if iterators else AFTER_NAMED if named else "',' or ')'")
        return tree.Call(function.at, function, tuple(arguments), named, iterators)

    def argument(self) -> tree.Expression:
        """An argument: an expression, or a function with some inputs bound."""
        at = self.at
        if not self.take("function"):
            return self.expression()
        name = self.dotted_name()
        self.expect("(")
        named = self.listed(self.named_argument) if self.kind != ")" else ()
        self.expect(")", AFTER_NAMED)
        return tree.PartialCall(at, name, named)

    def named_argument(self) -> tuple[str, tree.Expression]:
        """`a = 1`."""
        name = self.expect("name")
        self.expect("=")
        return name, self.argument()

    def for_indices(self) -> tuple[tree.Iterator, ...]:
        """`for i in 1:3, j`."""
        self.expect("for")
        return self.listed(self.iterator)

    def iterator(self) -> tree.Iterator:
        """`i in 1:3`, or `j`."""
        return self.expect("name"), self.expression() if self.take("in") else None

    def expression_list(self) -> tuple[tree.Expression, ...]:
        """Expressions with commas between them."""
        return self.listed(self.expression)

    def parentheses(self) -> tree.Expression:
        """An expression in parentheses, with subscripts behind them too, or a list of outputs."""
        at = self.at
        self.advance()
        items = self.listed(lambda: None if self.kind in (",", ")") else self.expression())
        self.expect(")")
        first = items[0]
        array = tree.OutputList(at, items) if len(items) > 1 or first is None else first
        return tree.Subscripted(at, array, self.array_subscripts()) if self.kind == "[" else array

    def dotted_name(self) -> str:
        """A name of a class, `.A.B`."""
        name = self.advance() if self.kind == "." else ""
        name += self.expect("name")
        while self.kind == "." and self.next_kind == "name":
            name += self.advance() + self.advance()
        return name
