"""Equations, statements, and constraints of Optimica."""

from gantrytau.modelica import tree
from gantrytau.modelica.declarations import DeclarationReader
from gantrytau.modelica.expressions import NAMES, SUM
from gantrytau.modelica.tokens import BLOCKS, Faulty

ENDS = frozenset({"end", "else", "elseif", "elsewhen", ""})
CONSTRAINT_RELATIONS = ("=", "<=", ">=")


class EquationReader(DeclarationReader):
    """Reads the items of sections; `section` is the last word of their kind: equation, algorithm or constraint."""

    def section_items(self, section: str) -> tuple[tree.EquationOrStatement, ...]:
        """Equations or statements of one section; a faulty one is told and left out."""
        items: list[tree.EquationOrStatement] = []
        while self.kind not in ENDS and not self.section_begins() and self.kind != "annotation":
            start = self.i
            try:
                items.append(self.item(section))
                self.close()
            except Faulty:
                self.recover(start)
        return tuple(items)

    def item(self, section: str) -> tree.EquationOrStatement:
        """An equation or a statement."""
        at, kind = self.at, self.kind
        if kind in ("if", "when"):
            return self.branching(section)
        if kind == "for":
            iterators = self.for_indices()
            items = self.loop(section, "for")
            return tree.ForLoop(at, *self.description(), iterators, items)
        if kind == "while" and section == "algorithm":
            self.advance()
            condition = self.expression()
            items = self.loop(section, "while")
            return tree.WhileLoop(at, *self.description(), condition, items)
        if section == "algorithm":
            return self.statement()
        if kind == "connect":
            joined = self.connect()
            return tree.ConnectEquation(at, *self.description(), joined.a, joined.b)
        return self.equation(section)

    def branching(self, section: str) -> tree.Branching:
        """`if` with `elseif` and `else`, `when` with `elsewhen`."""
        at, word, branches, otherwise = self.at, self.kind, [], None
        while not branches or self.take("else" + word):
            if not branches:
                self.advance()
            condition = self.expression()
            self.expect("then")
            branches.append((condition, self.section_items(section)))
        if word == "if" and self.take("else"):
            otherwise = self.section_items(section)
        self.end_of(word)
        return tree.Branching(at, *self.description(), word, tuple(branches), otherwise)

    def loop(self, section: str, word: str) -> tuple[tree.EquationOrStatement, ...]:
        """`loop ... end for`."""
        self.expect("loop")
        items = self.section_items(section)
        self.end_of(word)
        return items

    def end_of(self, word: str) -> None:
        """`end if`, with the word of the block."""
        if self.kind != "end" or self.next_kind not in (";", *BLOCKS):
            self.refuse(f"'end {word}'")
        at = self.at
        self.advance()
        found = self.kind
        if found != word:
            self.note(at, f"found 'end{'' if found == ';' else ' ' + found}', expected 'end {word}'")
        if found != ";":
            self.advance()

    def equation(self, section: str) -> tree.SimpleEquation | tree.ProcedureCall:
        """`a = b`, or a call; in constraints also `a <= b`."""
        at, constraint = self.at, section == "constraint"
        left = self.simple_expression(SUM if constraint else 1)
        relations = CONSTRAINT_RELATIONS if constraint else ("=",)
        if self.kind in relations:
            relation = self.advance()
            right = self.expression()
            return tree.SimpleEquation(at, *self.description(), relation, left, right)
        if isinstance(left, tree.Call) and not constraint:
            return tree.ProcedureCall(at, *self.description(), left)
        if constraint:
            self.refuse("'=', '<=' or '>='")
        return self.refuse("'=', as ':=' is for algorithms" if self.kind == ":=" else "'='")

    def statement(self) -> tree.EquationOrStatement:
        """An assignment, a call, `break` or `return`."""
        at, kind = self.at, self.kind
        if kind in ("break", "return"):
            word = self.advance()
            return tree.Leave(at, *self.description(), word)
        if kind == "(":
            return self.assignment_of_several()
        if kind not in NAMES:
            self.refuse("a statement")
        name = self.component_reference()
        if self.kind == "(":
            call = self.call(name)
            return tree.ProcedureCall(at, *self.description(), call)
        if self.kind != ":=":
            self.refuse("':=', as '=' is for equations" if self.kind == "=" else "':='")
        self.advance()
        value = self.expression()
        return tree.Assignment(at, *self.description(), False, (name,), value)

    def assignment_of_several(self) -> tree.Assignment:
        """`(a, , b) := f(...)`."""
        at, outputs = self.at, self.parentheses()
        items = outputs.items if isinstance(outputs, tree.OutputList) else (outputs,)
        targets: list[tree.ComponentReference | None] = []
        for item in items:
            if item is not None and not isinstance(item, tree.ComponentReference):
                self.note(item.at, "found an expression, expected a name to assign to, or nothing")
            targets.append(item if isinstance(item, tree.ComponentReference) else None)
        self.expect(":=")
        name = self.component_reference()
        if self.kind != "(":
            self.refuse("the call of a function with several results")
        call = self.call(name)
        return tree.Assignment(at, *self.description(), True, tuple(targets), call)
