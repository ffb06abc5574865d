"""Optimizations of Optimica in the terms of Modelica: times are parameters, inputs with a binding are equations."""

from collections.abc import Iterator
from dataclasses import replace

from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.modelica import tree
from gantrytau.modelica.source import SourceText

TIMES = {"startTime": "when it begins", "finalTime": "when it ends"}
HORIZON = "OptimizationHorizon"  # a class of the root with both times
COSTS = ("objective", "objectiveIntegrand", "static")


def with_parameters(one: tree.ClassDefinition, source: SourceText) -> tree.ClassDefinition:
    """A class, in which each optimization declares its times, and has equations for inputs bound to those of components."""
    body = one.body
    if not isinstance(body, tree.Composition):
        return one
    inner = [
        [with_parameters(i, source) if isinstance(i, tree.ClassDefinition) else i for i in s.items]
        for s in body.sections
    ]
    sections = tuple(replace(s, items=tuple(items)) for s, items in zip(body.sections, inner, strict=True))
    stray = next((s for s in sections if s.kind == "constraint"), None)
    if one.kind != "optimization" and stray is not None:
        words = f"found constraints in the {one.kind} {one.name}, expected them in an optimization"
        raise ModelError(source.told(stray.at, words))
    if one.kind != "optimization":
        return replace(one, body=replace(body, sections=sections))
    own: list[tree.Element] = [tree.Extends(one.at, f".{HORIZON}", None, None)]
    own += [_time(argument) for argument in _times(body.arguments or (), source)]
    bound: list[tree.EquationOrStatement] = []
    sections = tuple(
        replace(s, items=tuple(_unbound(i, bound) for i in s.items))
        if s.kind in ("", "public", "protected")
        else s
        for s in sections
    )
    first = tree.ClassSection(one.at, "", tuple(own))
    last = tree.ClassSection(one.at, "equation", tuple(bound))
    return replace(one, body=replace(body, sections=(first, *sections, last)))


def _times(arguments: tuple[tree.AnyArgument, ...], source: SourceText) -> Iterator[tree.Argument]:
    """The times among the arguments of an optimization; ModelError for an argument that it does not have."""
    seen: set[str] = set()
    for argument in arguments:
        name = argument.name if isinstance(argument, tree.Argument) else "redeclare"
        if name not in (*TIMES, *COSTS):
            hint = did_you_mean(name, (*TIMES, *COSTS))
            raise ModelError(
                source.told(argument.at, f"found '{name}', which an optimization does not have{hint}")
            )
        if name in seen:
            raise ModelError(source.told(argument.at, f"found a second '{name}', expected one"))
        seen.add(name)
        if isinstance(argument, tree.Argument) and name in TIMES:
            yield argument


def _time(argument: tree.Argument) -> tree.ComponentClause:
    """`finalTime(min=1) = 2` as `redeclare parameter Real finalTime(free=false, min=1) = 2`."""
    at, said = argument.at, argument.modification
    given, value = (None, None) if said is None else (said.arguments, said.value)
    names = {one.name for one in given or () if isinstance(one, tree.Argument)}
    fixed = tree.Modification(at, None, tree.BooleanLiteral(at, False))
    extra = () if value is None or "free" in names else (tree.Argument(at, (), "free", fixed, None),)
    name, description = argument.name, argument.description or TIMES[argument.name]
    told = tree.Modification(at, (*extra, *(given or ())), value)
    declared = tree.ComponentDeclaration(at, description, None, name, (), told, None)
    return tree.ComponentClause(at, ("redeclare", "parameter"), "Real", (), (declared,), None)


def _unbound(
    item: tree.Element | tree.EquationOrStatement, equations: list[tree.EquationOrStatement]
) -> tree.Element | tree.EquationOrStatement:
    """A clause whose inputs are not bound to variables of components; what was bound is among the equations."""
    if not isinstance(item, tree.ComponentClause) or "input" not in item.prefixes:
        return item
    components: list[tree.ComponentDeclaration] = []
    for one in item.components:
        said = one.modification
        if said is not None and isinstance(said.value, tree.ComponentReference) and len(said.value.parts) > 1:
            name = tree.ComponentReference(one.at, ((one.name, ()),))
            equations.append(tree.SimpleEquation(one.at, None, None, "=", name, said.value))
            one = replace(one, modification=replace(said, value=None))
        components.append(one)
    return replace(item, components=tuple(components))
