"""Which column of a log is what: the names and units in its header."""

import re
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from gantrytau import ModelError
from gantrytau.border.columns import Columns
from gantrytau.border.units import scale

WORDS = {  # last part of a column's name, in small letters -> what it is
    **dict.fromkeys(("t", "time", "timestamp"), "t"),
    **dict.fromkeys(("q", "s", "phi", "pos", "position"), "q"),
    **dict.fromkeys(("f", "tau", "force", "torque"), "f"),
    **dict.fromkeys(("v", "w", "qd", "dq", "speed", "velocity"), "v"),
}
UNITS = {"t": ("s",), "q": ("m", "rad"), "f": ("N", "N.m"), "v": ("m/s", "rad/s"), "r": ("m",)}
TOOL = ({f"{name}{axis}": k for k, axis in enumerate("xyz")} for name in ("", "r_", "tool.", "tool_"))
TOOL = (
    *TOOL,
    {f"tool.r[{k}]": k for k in range(3)},
    {f"r{k + 1}": k for k in range(3)},
    {f"r[{k}]": k for k in range(3)},
)
EXPECTED = (
    "expected t,q1,q2,q3,f1,f2,f3, or time,carts[0].s,...,carts[0].f,..., and perhaps v1,v2,v3 and x,y,z, each with its "
    "unit if that is not SI: 'q1 [mm]'"
)
_FLAT = re.compile(r"(?P<word>[a-z]+)_?(?:\[(?P<from_0>\d+)\]|(?P<from_1>\d*))$")
_NUMBER = re.compile(r"(?P<before>.*?)_?\[?(?P<number>\d+)\]?(?P<after>[^\d]*)$")


@dataclass(frozen=True)
class _Header:
    place: int
    text: str
    name: str
    unit: str | None


def columns_of(table: Columns) -> dict[str, list[int]]:
    """The columns of a log by the names in its header, in any order; those with other names are not read.

    Their indices in the order of the actuators: one of "t", those of "q" and "f", and of "v" and "r" where they are there.
    Raises ModelError for columns that are missing, stand twice, or could be meant in two ways.
    """
    heads = [
        _Header(k, text, name.lower(), table.units[k])
        for k, (text, name) in enumerate(zip(table.header, table.names, strict=True))
    ]
    place = f"{table.path}: found the header {', '.join(table.header)[:300]}"
    tool = _tool(place, heads)
    times = [head for head in heads if WORDS.get(head.name) == "t"]
    if len(times) != 1:
        raise ModelError(f"{place}: found {len(times) or 'no'} columns of time; {EXPECTED}")
    joints = _joints(place, heads, {head.place for head in tool or ()})
    for position, force in zip(joints["q"], joints["f"], strict=True):
        if _is_of(position, "m") and _is_of(force, "N.m"):
            raise ModelError(
                f"{place}: found {force.text} beside {position.text}, expected a force along a length; divide torques of "
                "motors by the radius of the transmission, and write N"
            )
    found = {"t": times, **joints} | ({"r": tool} if tool else {})
    return {kind: [head.place for head in each] for kind, each in found.items()}


def _is_of(head: _Header, unit: str) -> bool:
    """Whether a column says that it is in a unit of what another one measures."""
    try:
        return bool(head.unit) and scale(head.unit).measures(unit)
    except ModelError:
        return False


def _tool(place: str, heads: Sequence[_Header]) -> list[_Header] | None:
    """The three columns of tool positions, or None."""
    for names in TOOL:
        found = sorted((head for head in heads if head.name in names), key=lambda head: names[head.name])
        if [names[head.name] for head in found] == [0, 1, 2]:
            return found
        if found:
            raise ModelError(
                f"{place}: found {', '.join(head.text for head in found)} of the tool position, expected {', '.join(names)}"
                ", each once; complete them, or leave them out"
            )
    return None


def _joints(place: str, heads: Sequence[_Header], others: set[int]) -> dict[str, list[_Header]]:
    """Columns of actuators by what they are, each kind in the order of the actuators."""
    groups: dict[str, dict[str, dict[int, _Header]]] = defaultdict(lambda: defaultdict(dict))
    for head in heads:
        if head.place in others or (named := _named(head.name)) is None:
            continue
        owner, kind, number = named
        if number in groups[owner][kind]:
            twice = groups[owner][kind][number].text
            raise ModelError(
                f"{place}: found {twice} and {head.text}, expected one column for each; rename the other"
            )
        groups[owner][kind][number] = head
    whole = [owner for owner, kinds in groups.items() if "q" in kinds and "f" in kinds]
    if not whole:
        kinds = {kind for each in groups.values() for kind in each}
        missing = " and ".join(
            words for kind, words in (("q", "positions"), ("f", "forces")) if kind not in kinds
        )
        raise ModelError(
            f"{place}: found no columns of {missing or 'positions and forces of the same parts'}; {EXPECTED}"
        )
    least = min(owner.count(".") for owner in whole)
    nearest = [owner for owner in whole if owner.count(".") == least]
    if len(nearest) > 1:
        raise ModelError(
            f"{place}: found positions and forces of {' and of '.join(nearest)}, expected those of the actuators only; "
            "leave the others out, or call them q1, f1 and so on"
        )
    kinds = groups[nearest[0]]
    _check_numbers(place, kinds)
    return {kind: [kinds[kind][number] for number in sorted(kinds[kind])] for kind in kinds}


def _named(name: str) -> tuple[str, str, int] | None:
    """Owner, kind and number of an actuator's column: "q1" is ("", "q", 1), "carts[0].f" ("carts[#]", "f", 0)."""
    owner, dot, word = name.rpartition(".")
    flat = _FLAT.match(word)
    kind = WORDS.get(flat["word"]) if flat else None
    if flat is None or kind in (None, "t"):
        return None
    number = flat["from_0"] or flat["from_1"]
    if not dot or number:
        return owner, str(kind), int(number or 0)
    numbered = _NUMBER.match(owner)
    if numbered is None:
        return owner, str(kind), 0
    return f"{numbered['before']}[#]{numbered['after']}", str(kind), int(numbered["number"])


def _check_numbers(place: str, kinds: dict[str, dict[int, _Header]]) -> None:
    """ModelError unless positions, forces and speeds are those of the same actuators, none left out."""
    numbers = sorted(set().union(*kinds.values()))
    numbers = range(min(numbers[0], 1), numbers[-1] + 1)
    words = {"q": "position", "f": "force", "v": "speed"}
    missing = [f"{words[kind]} {number}" for kind in kinds for number in numbers if number not in kinds[kind]]
    if missing:
        raise ModelError(
            f"{place}: found no column of {', '.join(missing)}; {EXPECTED}. A robot whose actuators are not all logged "
            "cannot be identified: the others do work too"
        )
