"""The families of problems; `python -m tests.classics.families FAMILY PROBLEM` prints the line of one as JSON."""

import json
import sys
import warnings
from collections.abc import Callable, Sequence
from typing import Any

from tests.classics import estimation, iftomm, initial_values, optimal_control
from tests.classics.row import Row

FAMILIES: dict[str, tuple[Sequence[Any], Callable[[Any], Row]]] = {
    "initial_values": (initial_values.PROBLEMS, initial_values.run),
    "mechanisms": (iftomm.PROBLEMS, iftomm.run),
    "optimal_control": (optimal_control.PROBLEMS, optimal_control.run),
    "estimation": (estimation.PROBLEMS, estimation.run),
}

if __name__ == "__main__":
    problems, run = FAMILIES[sys.argv[1]]
    (problem,) = [one for one in problems if one.name == sys.argv[2]]
    warnings.simplefilter("ignore")
    print(json.dumps(run(problem)))
