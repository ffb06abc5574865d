"""`make classics`: the problems by which the fields judge themselves, a table for each family, and the page of the site.

By environment: ONLY, a family or a problem; TIME_LIMIT, s of processor time of a problem. A line tells of each problem as it
ends, and the file of the site has it from then on.
"""

import json
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

from tests.classics.families import FAMILIES
from tests.classics.row import Row
from tests.classics.summary import print_family, write_families

ROOT = Path(__file__).parents[2]
PROCESSES = 2
TIME_LIMIT = 600.0  # s of processor time: on a busy computer the longest takes 300
SIGXCPU = 24  # by which a system ends what exceeds its processor time
STUCK = 20  # times as long on the clock: on a busy computer


def measured(family: str, name: str, limit: float) -> Row:
    """The line of a problem, run in a process of its own."""
    command = [sys.executable, "-m", "tests.classics.families", family, name, f"{limit:g}"]
    late: Row = {"failure": f"longer than {limit:g} s", "held": False}
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=STUCK * limit, cwd=ROOT)
    except subprocess.TimeoutExpired:
        return late
    if done.returncode == -SIGXCPU:
        return late
    if done.returncode:
        last = (done.stderr.strip().splitlines() or [f"ended with {done.returncode}"])[-1]
        return {"failure": last, "held": False}
    return json.loads(done.stdout.splitlines()[-1])


def main() -> int:
    """Runs what is asked for, prints the tables and writes those of the site; 1 where a problem does not hold."""
    only, limit = os.environ.get("ONLY", ""), float(os.environ.get("TIME_LIMIT") or TIME_LIMIT)
    asked = [
        (family, one.name)
        for family, (problems, _) in FAMILIES.items()
        for one in problems
        if only in ("", family, one.name)
    ]
    if not asked:
        known = ", ".join((*FAMILIES, *(one.name for problems, _ in FAMILIES.values() for one in problems)))
        raise SystemExit(f"classics: found ONLY={only}, expected one of {known}")
    found: dict[tuple[str, str], Row] = {}
    begin = time.monotonic()
    with ThreadPoolExecutor(PROCESSES) as pool:
        runs = {pool.submit(measured, family, name, limit): (family, name) for family, name in asked}
        for run in as_completed(runs):
            family, name = runs[run]
            row = found[family, name] = run.result()
            write_families({family: {name: row}})
            told = row.get("failure") or ("held" if row["held"] else "not held")
            print(
                f"{len(found)} of {len(asked)}, {time.monotonic() - begin:.0f} s: {name} {told}", flush=True
            )
    for family in dict.fromkeys(family for family, _ in asked):
        print_family(family, {name: found[of, name] for of, name in asked if of == family})
    return int(not all(row["held"] for row in found.values()))


if __name__ == "__main__":
    sys.exit(main())
