"""Files, classes and their sections: the outer half of the grammar, and what reads a whole text."""

import os

from gantrytau.modelica import tree
from gantrytau.modelica.base_modelica import without_guesses
from gantrytau.modelica.declarations import CLASS_BEGINS, ELEMENT_PREFIXES
from gantrytau.modelica.equations import ENDS, EquationReader
from gantrytau.modelica.source import SourceText
from gantrytau.modelica.tokens import BLOCKS, Faulty

IN_REFERENCES = ("name", "number", "[", "]", ".", ":", ",")
BEHIND_NAMES = CLASS_BEGINS | {"string", "=", "name", "end"}
ELEMENT_SECTIONS = ("", "public", "protected")


def read_tree(path: str | os.PathLike[str]) -> tree.StoredDefinition:
    """The tree of a `.mo` or `.mop` file; ModelError with every fault in it, each with its line."""
    return parse(SourceText.read(path))


def parse(source: SourceText) -> tree.StoredDefinition:
    """The tree of a text; ModelError with every fault in it, each with its line."""
    parser = Parser(source)
    try:
        found = parser.stored_definition()
    except RecursionError:
        parser.note(parser.at, "found brackets or blocks that lie too deep in each other to be read")
        found = None
    parser.raise_faults()
    assert found is not None
    return found


class Parser(EquationReader):
    """Reads files and classes."""

    def __init__(self, source: SourceText):
        super().__init__(source)
        self.open_classes: list[str] = []

    def stored_definition(self) -> tree.StoredDefinition:
        """A file."""
        within, classes = None, []
        try:
            if self.take("within"):
                within = self.dotted_name() if self.kind in ("name", ".") else ""
                self.close()
        except Faulty:
            self.recover(0)
        while self.kind:
            start = self.i
            try:
                final = self.prefixes("final")
                if self.kind not in CLASS_BEGINS:
                    self.refuse("a class" if classes else "'within' or a class")
                classes.append(self.class_definition(final))
                self.close()
            except Faulty:
                while self.kind and (self.i <= start or self.kind not in CLASS_BEGINS):
                    self.advance()
        if not classes and not self.faults and self.unclosed is None:
            self.note(self.at, "found no class, expected 'within' or a class")
        return tree.StoredDefinition(0, within, tuple(classes), self.source)

    def class_definition(self, prefixes: tuple[str, ...]) -> tree.ClassDefinition:
        """A class of any kind; one without a name is read all the same, to see what else is wrong."""
        more, kind = self.class_kind()
        prefixes += more
        extends = self.take("extends")
        at = self.at
        name = self.class_name()
        if self.kind == "=" and not extends:
            self.advance()
            body, about = self.short_body()
            constraint = self.constrained_by(prefixes)
            return tree.ClassDefinition(at, *about, prefixes, kind, name, body, constraint)
        arguments = self.optional_modification() if extends or kind == "optimization" else None
        text = self.description_string()
        composition, annotation = self.composition(name, extends, arguments)
        constraint = self.constrained_by(prefixes)
        return tree.ClassDefinition(at, text, annotation, prefixes, kind, name, composition, constraint)

    def class_name(self) -> str:
        """The name of a class, or "" where it is missing."""
        try:
            return self.expect("name")
        except Faulty:
            if self.next_kind in ("string", "=") or self.kind not in BEHIND_NAMES:
                self.advance()  # a keyword or a number that was meant as the name
            return ""

    def composition(
        self, name: str, extends: bool, arguments: tuple[tree.AnyArgument, ...] | None
    ) -> tuple[tree.Composition, tree.Annotation]:
        """The sections of a class, up to `end name`, and its annotation."""
        at = self.at
        sections: list[tuple[int, str, list[tree.Element | tree.EquationOrStatement]]] = [(at, "", [])]
        external, annotation = None, None
        self.open_classes.append(name)
        while self.kind and not (self.kind == "end" and self.next_kind not in BLOCKS):
            start = self.i
            _, kind, items = sections[-1]
            try:
                if self.kind == "annotation":
                    if annotation is not None:
                        self.note(self.at, "found a second annotation of this class, expected one")
                    annotation = self.annotation()
                    self.close()
                elif self.kind == "external":
                    if external is not None:
                        self.note(self.at, "found a second external function, expected one")
                    external = self.external_function()
                elif self.section_begins():
                    begin, first = self.at, self.advance()
                    kind = f"{first} {self.advance()}" if first == "initial" else first
                    sections.append((begin, kind, []))
                elif self.kind == "parameter" and self.next_kind == "equation":
                    sections.append((self.at, f"{self.advance()} {self.advance()}", [self.item("equation")]))
                    sections.append((self.at, "", []))
                    self.close()
                elif self.kind in ENDS:
                    self.stray()
                elif kind in ELEMENT_SECTIONS and (section := self.forgotten_section()):
                    self.note(self.at, f"found an equation or a statement, expected '{section}' before it")
                    sections.append((self.at, section, []))
                elif kind in ELEMENT_SECTIONS:
                    items.append(self.element())
                    if self.kind != ";" and self.forgotten_section():  # more than a `;` is missing
                        self.refuse("';'")
                    self.close()
                else:
                    items.extend(self.section_items(kind.split()[-1]))
            except Faulty:
                self.recover(start)
                if self.i == start:
                    self.advance()
        self.end_of_class()
        shown = tuple(tree.ClassSection(a, word, tuple(own)) for a, word, own in sections if word or own)
        shown = without_guesses(shown) if self.source.base else shown
        return tree.Composition(at, extends, arguments, shown, external), annotation

    def forgotten_section(self) -> str:
        """The section whose first word is missing before an equation or a statement; "" before an element."""
        i, kinds = self.i, self.kinds
        if kinds[i] in ("connect", "der", *BLOCKS):
            return "algorithm" if kinds[i] == "while" else "equation"
        if kinds[i] != "name" or not self.texts[i][0].islower():  # a type begins with a capital
            return ""
        while kinds[i] in IN_REFERENCES and (kinds[i] != "name" or kinds[i + 1] != "name"):
            i += 1
        return {":=": "algorithm", "=": "equation"}.get(kinds[i], "")

    def stray(self) -> None:
        """An `else` or `end if` to which nothing belongs."""
        word = self.advance()
        if word == "end":
            word = f"end {self.advance()}"
        self.note(self.starts[self.i - len(word.split())], f"found '{word}', to which no block belongs")
        self.take(";")

    def end_of_class(self) -> None:
        """`end name` of a class; the name of an enclosing class ends that class, as the inner one lacks its `end`."""
        name = self.open_classes.pop()
        if self.kind == "":
            self.refuse(f"'end {name}'" if name else "'end' and a name")
        found = "" if self.next_kind == ";" else self.texts[min(self.i + 1, len(self.texts) - 1)]
        if name and found != name:
            words = f"'end {found}'" if found else "'end' without a name"
            self.note(self.at, f"found {words}, expected 'end {name}'")
            if found in self.open_classes:
                raise Faulty
        self.advance()
        if self.kind == "name" or (self.kind != ";" and self.next_kind == ";"):
            self.advance()

    def element(self) -> tree.Element:
        """A class, a clause of components, an import or an extends."""
        if self.kind == "import":
            return self.import_clause()
        if self.kind == "extends":
            return self.extends_clause()
        prefixes = self.prefixes(*ELEMENT_PREFIXES)
        if self.kind in CLASS_BEGINS:
            return self.class_definition(prefixes)
        if self.kind in ELEMENT_PREFIXES:
            self.refuse("prefixes in the order " + ", ".join(ELEMENT_PREFIXES))
        return self.component_clause(prefixes)

    def import_clause(self) -> tree.Import:
        """`import A.B`, `import C = A.B`, `import A.*`, `import A.{B, C}`."""
        self.expect("import")
        at, alias, names = self.at, None, None
        if self.next_kind == "=":
            alias = self.expect("name")
            self.advance()
        name = self.dotted_name()
        if alias is None and self.take(".*"):
            names = ("*",)
        elif alias is None and self.kind == "." and self.next_kind == "{":
            self.advance()
            self.advance()
            names = self.listed(lambda: self.expect("name"))
            self.expect("}")
        return tree.Import(at, *self.description(), name, alias, names)

    def extends_clause(self) -> tree.Extends:
        """`extends Type(...)`."""
        self.expect("extends")
        at, name = self.at, self.dotted_name()
        arguments = self.optional_modification(inherited=True)
        return tree.Extends(at, name, arguments, self.annotation())

    def external_function(self) -> tree.ExternalFunction:
        """`external "C" y = f(x) annotation(...);`."""
        at = self.at
        self.expect("external")
        language = self.advance() if self.kind == "string" else None
        result: tree.ComponentReference | None = None
        function, arguments = "", tuple[tree.Expression, ...]()
        if self.kind == "name":
            name = self.component_reference()
            if self.take("="):
                result = name
                name = self.component_reference()
            [*qualifiers, (function, subscripts)] = name.parts
            if qualifiers or subscripts:
                self.note(name.at, "found a reference, expected the plain name of an external function")
            self.expect("(")
            arguments = self.expression_list() if self.kind != ")" else ()
            self.expect(")")
        annotation = self.annotation()
        self.close()
        return tree.ExternalFunction(at, language, result, function, arguments, annotation)
