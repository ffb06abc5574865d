"""How `gantrytau calibrate measurements.csv` is to calibrate: its options as arguments of `calibrate`."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from gantrytau.commands.arguments.options import listed
from gantrytau.commands.arguments.values import number, split
from gantrytau.commands.printing.reporting import CommandError

MODELS = ("parallel", "1", "2", "3", "4", "5")
WORDS = {
    "method": ("gauss-newton", "ipopt"),
    "start": ("nominal", "linear"),
    "orientation": ("local", "unit", "free"),
    "holdout": ("second", "none"),
}
_IN_OPTIONS = (
    (r"([\w.\[\]]+)\[0\], \1\[1\], \1\[2\](, \1\[3\])?", r"\1"),  # vectors by their names
    (r"give Measurements\(\.\.\., rails=\[\.\.\.\]\)", "give --rails rail1.csv,rail2.csv,rail3.csv"),
    (r"loss='robust'", "--robust"),
    (r"method='ipopt' with a prior or a robust loss", "--method ipopt with --prior or --robust"),
    (r"holdout=None", "--holdout none"),
    (r"\b(take|with|or|for|expected) model=None", r"\1 no --model"),
    (r"found model=None", "found no --model"),
    (r"expected None; those models", "expected no --model; those models"),
    (r"\b(start|method|orientation|holdout|model)='?([\w-]+)'?", r"--\1 \2"),
    (r"\bfound constraints with\b", "found --constraint with"),
    (r"\bconstraint (on )?'", r"--constraint \1'"),
    (r"\bgive a prior\b", "give --prior NAME=DEVIATION"),
    (r"left out of \.error", "left out of the error"),
    (r"^calibrate: ", ""),
)


def policy(
    model: str | None,
    method: str,
    start: str,
    orientation: str,
    holdout: str,
    prior: str | None,
    constraints: Sequence[str],
    robust: bool,
) -> dict[str, Any]:
    """Keywords of `calibrate`; CommandError for words that it does not know."""
    for name, word in dict(method=method, start=start, orientation=orientation, holdout=holdout).items():
        if word not in WORDS[name]:
            raise CommandError(f"--{name} {word}: expected {' or '.join(WORDS[name])}")
    if model is not None and model not in MODELS:
        raise CommandError(
            f"--model {model}: expected one of {', '.join(MODELS)}; without --model guideways are straight, each with a "
            "direction of its own"
        )
    return dict(
        model=int(model) if model is not None and model.isdigit() else model,
        method=method,
        start=start,
        orientation=orientation,
        holdout=None if holdout == "none" else holdout,
        prior=_prior(prior),
        constraints=_constraints(constraints),
        loss="robust" if robust else "linear",
    )


def _prior(text: str | None) -> dict[str, Any] | None:
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


def _constraints(texts: Sequence[str]) -> dict[str, Any] | None:
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


def rail_files(text: str | None) -> list[Path]:
    """The files of `--rails`."""
    return [Path(name) for name in listed([text] if text else None)]


def in_options(message: str) -> str:
    """What is said to those who write Python, said with the options of the command."""
    for pattern, words in _IN_OPTIONS:
        message = re.sub(pattern, words, message)
    return message
