"""Modifications, annotations, components and short classes."""

from gantrytau.modelica import tree
from gantrytau.modelica.expressions import ExpressionReader

KINDS = frozenset({"class", "model", "record", "block", "connector", "type", "package"})
KINDS |= {"function", "operator", "optimization"}
BEFORE_KINDS = ("encapsulated", "partial", "pure", "impure", "expandable")
CLASS_BEGINS = KINDS | frozenset(BEFORE_KINDS)
ELEMENT_PREFIXES = ("redeclare", "final", "inner", "outer", "replaceable")
TYPE_PREFIXES = (("flow", "stream"), ("discrete", "parameter", "constant"), ("input", "output"))


class DeclarationReader(ExpressionReader):
    """Reads what stands in the elements of classes and in modifications alike."""

    def description(self) -> tuple[str | None, tree.Annotation]:
        """A description and an annotation."""
        return self.description_string(), self.annotation()

    def description_string(self) -> str | None:
        """`"a" + "b"`, joined."""
        if self.kind != "string":
            return None
        text = self.advance()
        while self.take("+"):
            text += self.expect("string")
        return text

    def annotation(self) -> tree.Annotation:
        """`annotation(...)`."""
        return self.class_modification() if self.take("annotation") else None

    def class_modification(self, inherited: bool = False) -> tuple[tree.AnyArgument, ...]:
        """Arguments in parentheses; inherited: of an `extends`, where `break` leaves something out."""
        self.expect("(")
        if self.take(")"):
            return ()
        arguments = self.listed(
            lambda: self.omission() if inherited and self.kind == "break" else self.modifier()
        )
        self.expect(")", "',' or ')'")
        return arguments

    def optional_modification(self, inherited: bool = False) -> tuple[tree.AnyArgument, ...] | None:
        """Arguments in parentheses if there are any."""
        return self.class_modification(inherited) if self.kind == "(" else None

    def omission(self) -> tree.Omission:
        """`break name` or `break connect(a, b)`."""
        at = self.at
        self.advance()
        return tree.Omission(at, self.connect() if self.kind == "connect" else self.expect("name"))

    def connect(self) -> tree.ConnectEquation:
        """`connect(a, b)`, without its description."""
        at = self.at
        self.expect("connect")
        self.expect("(")
        a = self.component_reference()
        self.expect(",")
        b = self.component_reference()
        self.expect(")")
        return tree.ConnectEquation(at, None, None, a, b)

    def modifier(self) -> tree.Argument | tree.Redeclaration:
        """One argument of a modification."""
        at = self.at
        redeclare = self.prefixes("redeclare")
        each = self.prefixes("each")
        before = self.prefixes("final", "replaceable")
        if redeclare or "replaceable" in before:
            return tree.Redeclaration(at, bool(each), self.replacing_element((*redeclare, *before)))
        at = self.at
        if self.kind != "name":
            self.refuse("a name, 'redeclare' or 'replaceable'")
        return tree.Argument(
            at, each + before, self.dotted_name(), self.modification(), self.description_string()
        )

    def replacing_element(self, prefixes: tuple[str, ...]) -> tree.ComponentClause | tree.ClassDefinition:
        """What `redeclare` or `replaceable` in a modification declares: a short class, or one component."""
        if self.kind in CLASS_BEGINS:
            more, kind = self.class_kind()
            at, name = self.at, self.expect("name")
            self.expect("=")
            body, about = self.short_body()
            constraint = self.constrained_by(prefixes)
            return tree.ClassDefinition(at, *about, prefixes + more, kind, name, body, constraint)
        return self.component_clause(prefixes, several=False)

    def prefixes(self, *words: str) -> tuple[str, ...]:
        """Those of some words that stand here, in this order."""
        return tuple(word for word in words if self.take(word))

    def modification(self) -> tree.Modification | None:
        """`(...) = value`, `= value` or `:= value`, which is an old way to write `=`."""
        if self.kind not in ("(", "=", ":="):
            return None
        at, arguments, value = self.at, self.optional_modification(), None
        if self.kind in ("=", ":="):
            self.advance()
            at = self.at
            value: tree.Expression | None = (
                tree.Mark(at, self.advance()) if self.kind == "break" else self.expression()
            )
        return tree.Modification(at, arguments, value)

    def component_clause(self, prefixes: tuple[str, ...], several: bool = True) -> tree.ComponentClause:
        """A type and its components, one in a modification."""
        prefixes += self.type_prefixes()
        at = self.at
        if self.kind not in ("name", "."):
            self.refuse("a type" if prefixes or not several else "a declaration, a class, or 'end'")
        type_name, subscripts = self.dotted_name(), self.array_subscripts()
        components = (
            self.listed(self.component_declaration) if several else (self.component_declaration(False),)
        )
        constraint = self.constrained_by(prefixes)
        return tree.ComponentClause(at, prefixes, type_name, subscripts, components, constraint)

    def type_prefixes(self) -> tuple[str, ...]:
        """`flow parameter input`, before a type."""
        return tuple(self.advance() for words in TYPE_PREFIXES if self.kind in words)

    def component_declaration(self, conditional: bool = True) -> tree.ComponentDeclaration:
        """A name with all that belongs to it."""
        at, name = self.at, self.expect("name")
        subscripts, modification = self.array_subscripts(), self.modification()
        condition = self.expression() if conditional and self.take("if") else None
        return tree.ComponentDeclaration(at, *self.description(), name, subscripts, modification, condition)

    def constrained_by(self, prefixes: tuple[str, ...]) -> tree.ConstrainedBy | None:
        """`constrainedby Type(...)` of what is replaceable."""
        if self.kind != "constrainedby" or "replaceable" not in prefixes:
            return None
        self.advance()
        at, type_name = self.at, self.dotted_name()
        arguments = self.optional_modification()
        return tree.ConstrainedBy(at, *self.description(), type_name, arguments)

    def class_kind(self) -> tuple[tuple[str, ...], str]:
        """The words before the name of a class: its prefixes, and its kind."""
        prefixes = self.prefixes(*BEFORE_KINDS)
        if prefixes == ("pure",) and self.source.base:
            prefixes += self.prefixes("constant")
        if self.kind == "operator" and self.next_kind in ("function", "record"):
            prefixes += (self.advance(),)
        if self.kind not in KINDS:
            self.refuse(f"a kind of class behind '{prefixes[-1]}'" if prefixes else "a class")
        return prefixes, self.advance()

    def short_body(
        self,
    ) -> tuple[tree.ShortClass | tree.Enumeration | tree.DerivativeClass, tuple[str | None, tree.Annotation]]:
        """What stands behind the `=` of a class, and its description."""
        at = self.at
        if self.take("enumeration"):
            body = tree.Enumeration(at, self.enumeration_literals())
        elif self.take("der"):
            self.expect("(")
            function = self.dotted_name()
            self.expect(",")
            inputs = self.listed(lambda: self.expect("name"))
            self.expect(")")
            body = tree.DerivativeClass(at, function, inputs)
        else:
            prefixes, at = self.type_prefixes(), self.at
            if self.kind not in ("name", "."):
                self.refuse("a class, 'enumeration' or 'der'")
            name, subscripts = self.dotted_name(), self.array_subscripts()
            body = tree.ShortClass(at, prefixes, name, subscripts, self.optional_modification())
        return body, self.description()

    def enumeration_literals(self) -> tuple[tree.EnumerationLiteral, ...] | None:
        """`(a "first", b)`; None for `(:)`."""
        self.expect("(")
        literals = None
        if not self.take(":"):
            literals = self.listed(self.enumeration_literal) if self.kind != ")" else ()
        self.expect(")", "',' or ')'")
        return literals

    def enumeration_literal(self) -> tree.EnumerationLiteral:
        """`a "first"`."""
        at, name = self.at, self.expect("name")
        return tree.EnumerationLiteral(at, *self.description(), name)
