"""The families of problems; `python -m tests.classics.families FAMILY PROBLEM LIMIT` prints the line of one as JSON.

LIMIT: s of processor time, at which it is ended where the system does that.
"""

import json
import sys
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
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
    with suppress(ImportError):  # Windows has none
        import resource

        limit = round(float(sys.argv[3]))
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 5))
    problems, run = FAMILIES[sys.argv[1]]
    (problem,) = [one for one in problems if one.name == sys.argv[2]]
    warnings.simplefilter("ignore")
    print(json.dumps(run(problem)))
