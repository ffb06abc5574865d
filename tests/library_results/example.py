"""One example: read, simulated and compared; `python -m tests.library_results.example NAME` prints its outcome as JSON."""

import json
import os
import resource
import sys
import time
import warnings
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau import GantryTauError, ModelError, load_modelica, simulate
from gantrytau.results.run_statistics import INTEGRATION
from tests.library_results.references import Reference, references
from tests.library_results.tube import leaves

TOLERANCE = 1e-6  # of an experiment that says none
PASSED, LEFT, REFUSED, NOT_RUN, NO_REFERENCE = "passed", "left", "refused", "not run", "no reference"
LONGEST = 300  # characters of a message


@dataclass(frozen=True)
class Outcome:
    """What became of an example.

    word: passed, left, refused, not run or no reference; detail: the first signal that leaves and when, or the message;
    translate, simulate: processor time, s; key: of the sources, code and settings that the outcome is of.
    """

    name: str
    word: str
    detail: str = ""
    translate: float = 0.0
    simulate: float = 0.0
    key: str = ""


def outcome_of(reference: Reference, library: Path) -> Outcome:
    """Reads the example from the package of its name in the folder of libraries, runs and compares it."""
    if reference.missing:
        return Outcome(reference.name, NO_REFERENCE, reference.missing)
    begin, spent = time.process_time(), {}
    said = reference.settings
    try:
        made = load_modelica(library / reference.name.partition(".")[0])[reference.name]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            result: Any = simulate(
                made(),
                start=said.get("StartTime", 0.0),
                stop=said.get("StopTime"),
                tolerance=said.get("Tolerance", TOLERANCE),
                points=reference.points,
            )
        spent = result.statistics.seconds
        word, detail = _compared(result, reference)
    except ModelError as error:
        word, detail = REFUSED, one_line(error)
    except GantryTauError as error:
        word, detail = NOT_RUN, f"{type(error).__name__}: {one_line(error)}"
    except Exception as error:  # a fault of the program: told as any other message
        word, detail = NOT_RUN, f"{type(error).__name__}: {one_line(error)}"
    whole, run = time.process_time() - begin, spent.get(INTEGRATION, 0.0)
    return Outcome(reference.name, word, detail, round(whole - run, 3), round(run, 3))


def _compared(result: Any, reference: Reference) -> tuple[str, str]:
    """Whether all signals stay in their tubes, and which leaves first."""
    found = reference.trajectories
    at, left, unknown = np.asarray(result["time"]), [], []
    for name in reference.signals:
        if name not in found:
            continue
        if name not in result:
            unknown.append(name)
            continue
        values = np.broadcast_to(np.asarray(result[name], dtype=float), at.shape)
        when = leaves(at, values, found["time"], found[name])
        if when is not None:
            left.append((when, name))
    if unknown:
        return LEFT, f"no variable {', '.join(unknown[:3])}{' ...' if len(unknown) > 3 else ''}"
    if left:
        when, name = min(left)
        return LEFT, f"{name} at {when:.6g} s ({len(left)} of {len(reference.signals)} signals)"
    return PASSED, ""


def one_line(error: BaseException) -> str:
    """A message without line breaks, shortened."""
    text = " ".join(str(error).split())
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 4]} ..."


if __name__ == "__main__":
    name, library, root, limit = sys.argv[1:]
    resource.setrlimit(resource.RLIMIT_CPU, (round(float(limit)), round(float(limit)) + 5))
    (asked,) = [one for one in references(Path(root), name) if one.name == name]
    os.environ["MODELICAPATH"] = library
    print(json.dumps(asdict(outcome_of(asked, Path(library)))))
