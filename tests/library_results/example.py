"""One example: read, simulated and compared; `python -m tests.library_results.example NAME` prints its outcome as JSON."""

import json
import resource
import sys
import time
import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau import GantryTauError, ModelError, load_modelica, simulate
from gantrytau.results.run_statistics import INTEGRATION
from gantrytau.results.tube import leaves
from tests.library_results.references import Example, Reference, references

TOLERANCE = 1e-6  # of an experiment that says none
PASSED, LEFT, REFUSED, NOT_RUN, NO_REFERENCE = "passed", "left", "refused", "not run", "no reference"
RAN = "ran"  # to its end, without a reference to compare with
# of the run: where a motion is shorter than the interval of the output times, it is run again alone
BEGINNING = 0.01
LONGEST = 300  # characters of a message


@dataclass(frozen=True)
class Outcome:
    """What became of an example.

    word: passed, left, refused, not run, no reference or ran; detail: the first signal that leaves and when, or the message;
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
    compared = not isinstance(reference, Example)
    if compared and reference.missing:
        return Outcome(reference.name, NO_REFERENCE, reference.missing)
    begin, spent = time.process_time(), {}
    try:
        made = load_modelica(library / reference.name.partition(".")[0])[reference.name]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            result = _run(made(), reference, reference.settings.get("StopTime"))
            spent = result.statistics.seconds
            word, detail, last = compare([result], reference) if compared else (RAN, "", -np.inf)
            start, end = (float(result["time"][k]) for k in (0, -1))
            if start < last < start + BEGINNING * (end - start):
                again = _run(made(), reference, start + 2 * (last - start))
                word, detail, _ = compare([result, again], reference)
    except ModelError as error:
        word, detail = REFUSED, one_line(error).replace(f"{library}/", "")
    except GantryTauError as error:
        word, detail = NOT_RUN, f"{type(error).__name__}: {one_line(error)}"
    except Exception as error:  # a fault of the program: told as any other message
        word, detail = NOT_RUN, f"{type(error).__name__}: {one_line(error)}"
    whole, run = time.process_time() - begin, spent.get(INTEGRATION, 0.0)
    return Outcome(reference.name, word, detail, round(whole - run, 3), round(run, 3))


def _run(model: Any, reference: Reference, stop: float | None) -> Any:
    said = reference.settings
    if isinstance(reference, Example):
        return simulate(model, singular="cross")
    return simulate(
        model,
        start=said.get("StartTime", 0.0),
        stop=stop,
        tolerance=said.get("Tolerance", TOLERANCE),
        points=reference.points,
        singular="cross",
    )


def compare(results: Sequence[Any], reference: Reference) -> tuple[str, str, float]:
    """Whether all signals stay in their tubes, which leaves first, and the last time outside; results: of one motion."""
    found = reference.trajectories
    times = np.concatenate([one["time"] for one in results])
    order = np.argsort(times, kind="stable")
    at, left, unknown, last = times[order], [], [], -np.inf
    for name in reference.signals:
        if name not in found:
            continue
        if name not in results[0]:
            unknown.append(name)
            continue
        values = [np.broadcast_to(np.asarray(one[name], dtype=float), one["time"].shape) for one in results]
        when, _ = leaves(at, np.concatenate(values)[order], found["time"], found[name])
        if when.size:
            left.append((when[0], name))
            last = max(last, when[-1])
    if unknown:
        return LEFT, f"no variable {', '.join(unknown[:3])}{' ...' if len(unknown) > 3 else ''}", -np.inf
    if left:
        when, name = min(left)
        return LEFT, f"{name} at {when:.6g} s ({len(left)} of {len(reference.signals)} signals)", last
    return PASSED, "", last


def one_line(error: BaseException) -> str:
    """The first line of a message, shortened; the line of the library that may follow stays where it is."""
    text = (str(error).strip() or type(error).__name__).splitlines()[0]
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 4]} ..."


if __name__ == "__main__":
    name, library, root, limit = sys.argv[1:]
    resource.setrlimit(resource.RLIMIT_CPU, (round(float(limit)), round(float(limit)) + 5))
    known = references(Path(root), name) if root else [Example(Path(library), name)]
    (asked,) = [one for one in known if one.name == name]
    print(json.dumps(asdict(outcome_of(asked, Path(library)))))
