"""The options `--prior` and `--constraint` of `gantrytau calibrate measurements.csv`, read into values."""

from collections.abc import Sequence
from typing import Any

from gantrytau.border import listed
from gantrytau.commands.arguments.values import number, split
from gantrytau.commands.printing.reporting import CommandError


def prior_values(text: str | None) -> dict[str, Any] | None:
    """`plate_offset=0.001,arms[0].length=[1.5,0.002]` as deviations, or as pairs of value and deviation."""
    found: dict[str, Any] = {}
    for entry in listed([text] if text else None):
        wrong = CommandError(
            f"--prior {entry}: expected NAME=DEVIATION, or NAME=[VALUE,DEVIATION], as plate_offset=0.001, the deviation "
            "above 0"
        )
        if "=" not in entry:
            raise wrong
        name, value = split("--prior", entry)
        deviation = number("--prior", name, value)
        pair = deviation if isinstance(deviation, list) else [0.0, deviation]
        if len(pair) != 2 or any(isinstance(x, (bool, list)) for x in pair) or not pair[1] > 0:
            raise wrong
        found[name] = tuple(deviation) if isinstance(deviation, list) else deviation
    return found or None


def constraint_values(texts: Sequence[str]) -> dict[str, Any] | None:
    """`arms[0].length=2.05`, `arms[0].length=[2.0,2.1]`, `|arms[0].direction|=1`, `arms[0].length=arms[1].length`."""
    found: dict[str, Any] = {}
    for entry in listed(list(texts)):
        name, _, value = (part.strip() for part in entry.partition("="))
        if not (name and value):
            raise CommandError(
                f"--constraint {entry}: expected NAME=VALUE, NAME=[LEAST,MOST] or NAME=NAME, as 'arms[0].length=[2.0,2.1]'; "
                "|NAME| is the length of a vector"
            )
        if name in found:
            raise CommandError(f"--constraint {entry}: found {name} twice, expected once; give [LEAST,MOST]")
        if value.strip("|")[:1].isalpha():
            found[name] = value
            continue
        numbers = number("--constraint", name, value)
        found[name] = tuple(numbers) if isinstance(numbers, list) and len(numbers) == 2 else numbers
    return found or None
