"""Every public function refuses another word, and what is no number, by the argument's name, before it looks further.

Required arguments are stand-ins: words and numbers are looked at first, so that a slip in them costs no time.
"""

import importlib
import inspect
from dataclasses import is_dataclass
from typing import Any, Literal, Union, Unpack, get_args, get_origin, get_type_hints

import pytest

from gantrytau import GantryTauError, Model

DOORS = (
    "gantrytau",
    "gantrytau.kinematics",
    "gantrytau.viewing",
    "gantrytau.mechanics.robot_files",
    "gantrytau_models",
    "gantrytau_models.leadthrough",
    "gantrytau_optimica",
    "gantrytau_optimica.calibration",
    "gantrytau_optimica.estimation",
    "gantrytau_optimica.identification",
    "gantrytau_optimica.learning",
    "gantrytau_optimica.procedure",
    "gantrytau_optimica.vision",
    "gantrytau_fmu",
    "gantrytau_fmu.controller",
    "gantrytau_fmu.hardware",
)
NO_NUMBERS = (float("nan"), "many", True, [1.0, "a"])
NO_WORDS = ("wordless", 7, ["a"])


def hints(function: Any) -> dict[str, Any]:
    """The annotations of the arguments, those of `**keywords: Unpack[TypedDict]` too; those written as text name what is
    imported late.
    """
    found = {p.name: p.annotation for p in inspect.signature(function).parameters.values()}
    for hint in list(found.values()):
        found |= get_type_hints(get_args(hint)[0]) if get_origin(hint) is Unpack else {}
    return found


def members(hint: Any) -> tuple[Any, ...]:
    """The alternatives of an annotation."""
    return get_args(hint) if get_origin(hint) in (Union, type(int | str)) else (hint,)


def wrong_values(hint: Any) -> tuple[Any, ...]:
    """What an argument of words, or of a number, must refuse; nothing for all other arguments."""
    kinds = [kind for kind in members(hint) if kind is not type(None)]
    if kinds and all(get_origin(kind) is Literal for kind in kinds):
        return NO_WORDS
    if kinds and all(kind in (int, float) or get_origin(kind) is Literal for kind in kinds):
        return NO_NUMBERS
    return ()


def checks_itself(kind: type) -> bool:
    """Whether people make objects of a class with arguments of their own: no model, no record that is only returned."""
    made = "__post_init__" if is_dataclass(kind) else "__init__"
    return not issubclass(kind, (Model, BaseException)) and made in vars(kind)


def cases() -> list[tuple[str, str]]:
    """(function, argument) of all doors, each function once."""
    found = {}
    for door in DOORS:
        module = importlib.import_module(door)
        for name in module.__all__:
            function = getattr(module, name)
            if not callable(function) or (inspect.isclass(function) and not checks_itself(function)):
                continue
            try:
                annotations = hints(function)
            except ValueError:
                continue
            for argument, hint in annotations.items():
                if wrong_values(hint):
                    found.setdefault((id(function), argument), (f"{door}:{name}", argument))
    return sorted(found.values())


CASES = cases()


@pytest.mark.parametrize(("path", "argument"), CASES, ids=map(" ".join, CASES))
def test_a_wrong_word_or_number_is_refused_by_its_name(path, argument):
    door, name = path.split(":")
    function = getattr(importlib.import_module(door), name)
    parameters = inspect.signature(function).parameters.values()
    required = {
        p.name: 1 if wrong_values(hints(function)[p.name]) == NO_NUMBERS else object()
        for p in parameters
        if p.default is p.empty and p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)
    }
    positional = [p.name for p in parameters if p.kind is p.POSITIONAL_ONLY]
    for wrong in wrong_values(hints(function)[argument]):
        values = {**required, argument: wrong}
        with pytest.raises(GantryTauError) as refusal:
            function(*[values.pop(one) for one in positional], **values)
        assert refusal.value.argument == argument, (wrong, str(refusal.value))
