"""`load_modelica`: files and folders of Modelica text as classes of the language."""

import contextlib
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, TypeVar

from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.modelica import tree
from gantrytau.modelica.elaboration.algorithms import called_class
from gantrytau.modelica.elaboration.classes import class_of
from gantrytau.modelica.elaboration.modifiers import NOTHING, annotated
from gantrytau.modelica.elaboration.scopes import ClassScope
from gantrytau.modelica.elaboration.structure import Structure
from gantrytau.modelica.optimizations import with_parameters
from gantrytau.modelica.parser import parse, read_tree
from gantrytau.modelica.references import Members
from gantrytau.modelica.source import SourceText

PREDEFINED = """
type Real end Real; type Integer end Integer; type Boolean end Boolean; type String end String;
partial class ExternalObject end ExternalObject;
type StateSelect = enumeration(never, avoid, default, prefer, always);
type AssertionLevel = enumeration(warning, error);
partial class OptimizationHorizon
  parameter Real startTime(unit="s") = 0 "when it begins";
  parameter Real finalTime(unit="s") = 1 "when it ends";
end OptimizationHorizon;
"""
FORMER = """
package SIunits "what version 3 of the Modelica Standard Library has under this name"
  extends Modelica.Units.SI;
  package Conversions
    extends Modelica.Units.Conversions;
    package NonSIunits = Modelica.Units.NonSI;
  end Conversions;
  type Temp_K = Modelica.Units.SI.Temperature;
  type Temp_C = Modelica.Units.NonSI.Temperature_degC;
end SIunits;
"""


class ModelicaLibrary:
    """Classes of Modelica text: `library["Package.Model"]` is a class as any other Model; keywords modify it."""

    kinds: ClassVar[tuple[str, ...]] = ("model", "block", "connector", "record", "class")  # that are named

    def __init__(self, paths: Sequence[Path], libraries: Sequence[Path]):
        self.root = ClassScope(_empty_package(""), SourceText("Modelica", ""), None)
        predefined = parse(SourceText("Modelica", PREDEFINED))
        for one in predefined.classes:
            made = ClassScope(one, predefined.source, self.root, predefined=one.kind == "type")
            self.root.classes[one.name] = made
        self.given: list[str] = []
        self._packages: dict[int, Structure] = {}
        self._classes: dict[str, type[Any]] = {}
        self._read: set[Path] = set()
        for path in paths:
            self.given += self._add(path)
        self.root.more = lambda name: _in_folders(libraries, name, self.root)

    def _add(self, path: Path) -> list[str]:
        """The classes of a file, or of a folder that is a package or holds files."""
        if path.is_dir() and not (path / "package.mo").is_file():
            files = sorted([*path.glob("*.mo"), *(p.parent for p in path.glob("*/package.mo"))])
            if not files:
                raise ModelError(
                    "found no Modelica file, expected a folder with package.mo or with .mo files",
                    place=str(path),
                )
            return [name for file in files for name in self._add(file)]
        path = _package_of(path)
        if path in self._read:
            return []
        self._read.add(path)
        found = [package_in(path, self.root)] if path.is_dir() else _in_file(path, self.root)
        for one in found:
            around = self.root if one.source.base else one.around or self.root
            other = around.classes.get(one.definition.name)
            if other is not None and not other.is_implied:
                one.refuse(one.definition.at, f"found a second class {one.name}, expected one")
            around.classes[one.definition.name] = one
            for inner in other.classes.values() if other is not None else ():
                inner.around = one
                one.classes.setdefault(inner.definition.name, inner)
        return [one.name for one in found]

    @property
    def names(self) -> tuple[str, ...]:
        """Full names of the models, blocks, connectors and records in the given files."""
        left = [*map(self._found, self.given)]
        for one in left:
            _read_all(one)
            left += [inner for inner in one.classes.values() if inner.around is one]
        return tuple(sorted({one.name for one in left if one.definition.kind in self.kinds}))

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def _found(self, name: str) -> ClassScope:
        return self.root.classes.get(name) or self.root.find_class(name, 0)

    def kind_of(self, name: str) -> str:
        """The word before the name of a class: model, block, connector, ...; "" for a partial one."""
        definition = self._found(name).definition
        return "" if "partial" in definition.prefixes else definition.kind

    def __getitem__(self, name: str) -> type[Any]:
        """The class of that full name; ModelError where there is none, or it cannot be made."""
        if not isinstance(name, str):
            raise ModelError(f"found {name!r}, expected the full name of a class, as 'Package.Model'")
        if name not in self._classes:
            scope: ClassScope | None = self.root
            for part in [name] if name in self.root.classes else name.split("."):
                scope = scope.inherited_class(part) if scope else None
            if scope is None:
                raise ModelError(f"found the name '{name}', expected a class{did_you_mean(name, self.names)}")
            if "partial" in scope.definition.prefixes:
                scope.refuse(
                    scope.definition.at, f"found {name}, which is partial, expected one that extends it"
                )
            structure = Structure(scope, NOTHING, self)
            structure.prepare()
            self._classes[name] = self.class_of(structure)
        return self._classes[name]

    def class_of(self, structure: Structure) -> type[Any]:
        """The class of a structure that is prepared."""
        return class_of(structure)

    def __contains__(self, name: str) -> bool:
        return name in self.names

    def __repr__(self) -> str:
        return f"ModelicaLibrary({', '.join(self.names)})"

    def package(self, scope: ClassScope) -> Structure:
        """The constants of a package."""
        return self._packages.setdefault(id(scope), Structure(scope, NOTHING, self))

    def call(
        self,
        scope: ClassScope,
        arguments: Sequence[Any],
        named: Mapping[str, Any],
        holder: Members | None = None,
    ) -> Any:
        """The value of a function, several as a tuple, or of the constructor of a record.

        holder: the instance of whose members modifications of the function speak.
        """
        return called_class(scope, arguments, named, self, holder)


Library = TypeVar("Library", bound=ModelicaLibrary)


def load_modelica(
    *paths: str | os.PathLike[str], libraries: Iterable[str | os.PathLike[str]] = ()
) -> ModelicaLibrary:
    """The classes of Modelica files and folders; their names are Modelica's own, `a[1].b`.

    paths: `.mo` files, and folders of packages; libraries: folders in which packages are looked for by name when a class
    needs them, those of MODELICAPATH too. Raises ModelError with file, line and column for what is no Modelica.
    """
    return loaded(ModelicaLibrary, "load_modelica('robot.mo')", paths, libraries)


def loaded(
    made: type[Library],
    example: str,
    paths: Sequence[str | os.PathLike[str]],
    libraries: Iterable[str | os.PathLike[str]],
) -> Library:
    """The classes of files and folders as a library of this kind; example: of a call, for messages."""
    if not paths:
        raise ModelError(f"{example.partition('(')[0]}: found no file, expected at least one, as {example}")
    several = isinstance(libraries, Iterable) and not isinstance(libraries, str)
    given = [_path(p, example) for p in (libraries if several else [libraries])]
    others = [Path(p) for p in os.environ.get("MODELICAPATH", "").split(os.pathsep) if p]
    for folder in given:
        if not folder.is_dir():
            raise ModelError(
                "found no folder of this name, expected one that holds packages",
                place=str(folder),
                argument="libraries",
            )
    return made(
        [_path(p, example) for p in paths], [*given, *(folder for folder in others if folder.is_dir())]
    )


def _path(given: Any, example: str) -> Path:
    if not isinstance(given, (str, os.PathLike)):
        raise ModelError(
            f"{example.partition('(')[0]}: found {given!r}, expected the path of a file or folder"
        )
    return Path(given)


def _package_of(path: Path) -> Path:
    """The folder of the outermost package of which a file or folder is a part, or itself."""
    inside = path.name == "package.mo" or path.is_dir()
    if not inside and path.is_file():
        inside = re.search(rb"^\s*within\s+[A-Za-z]", path.read_bytes(), re.MULTILINE) is not None
    while inside and (path.resolve().parent / "package.mo").is_file():
        path = path.resolve().parent
    return path


def _empty_package(name: str) -> tree.ClassDefinition:
    body = tree.Composition(0, False, None, (), None)
    return tree.ClassDefinition(0, None, None, (), "package", name, body, None)


def _in_file(path: Path, root: ClassScope) -> list[ClassScope]:
    """The classes of a file, within the package that it names if that is there."""
    found = read_tree(path)
    around = root
    if found.source.base:  # the one model, which has the name of the package around it
        (package, *others) = found.classes
        around = ClassScope(replace(package, name=""), found.source, root)
        models = [one for one in around.classes.values() if one.definition.kind == "model"]
        if others or len(models) != 1:
            count = f"{1 + len(others)} packages" if others else f"{len(models)} models"
            around.refuse(
                package.at, f"found {count}, expected one package with one model, as Base Modelica has"
            )
        return models
    for part in (found.within or "").split(".") if found.within else ():
        inner = around.own_class(part)
        if inner is None:  # the package itself is not given
            inner = ClassScope(_empty_package(part), found.source, around, is_implied=True)
            around.classes[part] = inner
        around = inner
    optimica = found.source.optimica
    classes = [with_parameters(one, found.source) if optimica else one for one in found.classes]
    return [ClassScope(one, found.source, around) for one in classes]


def package_in(folder: Path, around: ClassScope) -> ClassScope:
    """The package of a folder, whose classes are read when they are asked for."""
    found = read_tree(folder / "package.mo")
    (definition, *others) = found.classes
    if others or definition.name != folder.name.partition(" ")[0]:
        raise ModelError(
            found.source.told(
                definition.at,
                f"found '{definition.name}' in the folder {folder.name}, expected one package of that name",
            )
        )
    made = ClassScope(definition, found.source, around)
    made.more = lambda name: (
        _in_folder(folder, name, made) or _former(name, made) or _absent(folder, name, made)
    )
    return made


def _former(name: str, package: ClassScope) -> ClassScope | None:
    """A package that the library has no longer, by the names of today."""
    if (package.name, name) != ("Modelica", "SIunits"):
        return None
    found = parse(SourceText("Modelica", FORMER))
    return ClassScope(found.classes[0], found.source, package)


def _absent(folder: Path, name: str, package: ClassScope) -> None:
    """ModelError if the order of a package names a class that is not there: the copy of a library is not whole."""
    order = folder / "package.order"
    if order.is_file() and name in order.read_text("utf-8-sig").split() and name not in package.elements:
        raise ModelError(
            f"found no {name}.mo and no folder {name} with package.mo, expected one, as package.order names it: this copy "
            "of the package is not whole",
            place=str(folder),
        )


def _read_all(package: ClassScope) -> None:
    """Read the classes of a package that stand in files of their own."""
    file = Path(package.source.name)
    if file.name == "package.mo" and package.definition.name == file.parent.name.partition(" ")[0]:
        for place in sorted(file.parent.iterdir()):
            if place.suffix == ".mo" or (place / "package.mo").is_file():
                with contextlib.suppress(ModelError):  # told where the class is asked for
                    package.own_class(place.stem if place.suffix == ".mo" else place.name)


def _in_folder(folder: Path, name: str, around: ClassScope) -> ClassScope | None:
    if (folder / name / "package.mo").is_file():
        return package_in(folder / name, around)
    if name != "package" and (file := folder / f"{name}.mo").is_file():
        found = read_tree(file)
        (definition, *others), within = found.classes, found.within or around.name
        if around.name and (others or (definition.name, within) != (name, around.name)):
            words = f"found '{found.within or ''}.{definition.name}' in the file {file.name} of {around.name}"
            at = others[0].at if others else definition.at
            raise ModelError(found.source.told(at, f"{words}, expected the one class {around.name}.{name}"))
        return ClassScope(definition, found.source, around)
    if next((folder / name).glob("*.mo"), None) is not None:
        raise ModelError("found a folder without package.mo, expected one", place=str(folder / name))
    return None


def _in_folders(folders: Sequence[Path], name: str, root: ClassScope) -> ClassScope | None:
    """The package of a name, of the version at least that a package which was read `uses`."""
    users = {said: one.name for one in root.classes.values() if (said := version_of(one.definition, name))}
    asked = max(users, key=_numbers, default="")
    older: list[str] = []
    for folder in folders:
        versions = [p for p in folder.glob(f"{name} *") if (p / "package.mo").is_file()]
        versions.sort(key=lambda p: _numbers(p.name.partition(" ")[2]), reverse=True)
        for place in [folder / name] if (folder / name / "package.mo").is_file() else versions[:1]:
            found = package_in(place, root)
            here = version_of(found.definition)
            if not here or _numbers(here) >= _numbers(asked):
                return found
            older.append(f"version {here} in {place}")
        if not older and (one := _in_folder(folder, name, root)) is not None:
            return one
    if older:
        words = f"found {name} of {', '.join(older)}, expected {asked} or later, which {users[asked]} uses; give a folder"
        raise ModelError(f"{words} that holds it, libraries=[...], --library")
    return None


def version_of(definition: tree.ClassDefinition, used: str = "") -> str:
    """The version of a package, or the version of another package that its `uses` asks for; "" where it says none."""
    said = annotated(definition.annotation, *(("uses", used) if used else ()), "version")
    return said.value.text if said is not None and isinstance(said.value, tree.StringLiteral) else ""


def _numbers(version: str) -> tuple[int, ...]:
    """A version as numbers, of which one without zeros at its end is the same."""
    return tuple(map(int, re.findall(r"\d+", re.sub(r"(\.0)*([-+ ].*)?$", "", version))))
