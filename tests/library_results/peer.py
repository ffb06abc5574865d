"""`python -m tests.library_results.peer`: a sample of the examples simulated by rumoca, compared in the same tubes.

By environment: MODELICAPATH and REFERENCE_RESULTS as for the table; RUMOCA, an interpreter that can import rumoca, if this
one cannot; TIME_LIMIT, s of processor time for an example. The sample is spread over each package in order of names.
"""

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np

from tests.library_results.__main__ import TIME_LIMIT, folder_of
from tests.library_results.example import NOT_RUN, TOLERANCE, Outcome, compare, one_line
from tests.library_results.references import SIGNALS, Reference, references
from tests.library_results.summary import write_peer

SCRIPT = Path(__file__).with_name("run_rumoca.py")
SAMPLE = {
    "Modelica.Mechanics.Rotational": 4,
    "Modelica.Mechanics.Translational": 4,
    "Modelica.Blocks": 4,
    "Modelica.Electrical.Analog": 4,
    "Modelica.Mechanics.MultiBody": 4,
    "Modelica.Thermal.HeatTransfer": 3,
    "Modelica.StateGraph": 4,
    "ModelicaTest.Tables": 4,
}


def sample(found: Sequence[Reference]) -> list[Reference]:
    """Of each package its number of examples, evenly spread; one of each package after the other."""
    chosen = []
    for package, count in SAMPLE.items():
        within = [one for one in found if one.package == package and not one.missing]
        count = min(count, len(within))
        chosen.append([within[k * len(within) // count] for k in range(count)])
    return [one for row in zip_longest(*chosen) for one in row if one is not None]


def outcomes(asked: Sequence[Reference], command: Sequence[str]) -> Iterator[tuple[str, Outcome]]:
    """The version of the peer and the outcome of each; the command is started again after one that ended its process."""
    left = list(asked)
    while left:
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as peer:
            assert peer.stdin
            assert peer.stdout
            version = peer.stdout.readline()
            if not version:
                raise SystemExit(f"library-results: {command[0]} cannot import rumoca, expected one that can")
            while left:
                peer.stdin.write(json.dumps(_question(left[0])) + "\n")
                peer.stdin.flush()
                answer = peer.stdout.readline()
                if not answer:
                    break
                yield json.loads(version), _outcome(left.pop(0), json.loads(answer))
            peer.stdin.close()
        if left:
            detail = f"the process ended with {peer.returncode}"
            yield json.loads(version), Outcome(left.pop(0).name, NOT_RUN, detail)


def _question(one: Reference) -> dict[str, Any]:
    said = one.settings
    start, tolerance = said.get("StartTime", 0.0), said.get("Tolerance", TOLERANCE)
    asked = {"name": one.name, "start": start, "stop": said.get("StopTime", 1.0), "tolerance": tolerance}
    return {**asked, "points": one.points, "signals": one.signals}


def _outcome(one: Reference, answer: dict[str, Any]) -> Outcome:
    translate, simulate = round(answer["translate"], 3), round(answer.get("simulate", 0.0), 3)
    if "error" in answer:
        return Outcome(one.name, NOT_RUN, one_line(ValueError(answer["error"])), translate)
    values = {name: np.asarray(value, dtype=float) for name, value in answer["values"].items()}
    word, detail, _ = compare([values], one)
    return Outcome(one.name, word, detail, translate, simulate)


def main() -> int:
    """Runs the sample and keeps each outcome in the file of the site as it comes."""
    library = folder_of("MODELICAPATH", "package.mo", Path(os.environ.get("MODELICAPATH", "")).glob("*"))
    results = folder_of("REFERENCE_RESULTS", SIGNALS, Path(os.environ.get("REFERENCE_RESULTS", "")).glob("*"))
    limit = os.environ.get("TIME_LIMIT") or str(TIME_LIMIT)
    command = [os.environ.get("RUMOCA") or sys.executable, str(SCRIPT), str(library), limit]
    found: list[Outcome] = []
    for version, outcome in outcomes(sample(references(results)), command):
        print(f"{outcome.name}: {outcome.word} {outcome.detail}".rstrip(), flush=True)
        found.append(outcome)
        write_peer("rumoca", version, found)
    return 0


if __name__ == "__main__":
    sys.exit(main())
