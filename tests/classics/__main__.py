"""`make classics`: the problems by which the fields judge themselves, a table for each family, and the page of the site.

By environment: ONLY, a family or a problem; TIME_LIMIT, s of a problem on the clock.
"""

import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tests.classics.families import FAMILIES
from tests.classics.row import Row
from tests.classics.summary import print_family, write_families

ROOT = Path(__file__).parents[2]
PROCESSES = 2
TIME_LIMIT = 600.0  # s


def measured(family: str, name: str, limit: float) -> Row:
    """The line of a problem, run in a process of its own."""
    command = [sys.executable, "-m", "tests.classics.families", family, name]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=limit, cwd=ROOT)
    except subprocess.TimeoutExpired:
        return {"failure": f"longer than {limit:g} s", "held": False}
    if done.returncode:
        last = (done.stderr.strip().splitlines() or [f"ended with {done.returncode}"])[-1]
        return {"failure": last, "held": False}
    return json.loads(done.stdout.splitlines()[-1])


def main() -> int:
    """Runs what is asked for, prints the tables and writes those of the site; 1 where a problem does not hold."""
    only, limit = os.environ.get("ONLY", ""), float(os.environ.get("TIME_LIMIT") or TIME_LIMIT)
    asked = {
        family: [one.name for one in problems if only in ("", family, one.name)]
        for family, (problems, _) in FAMILIES.items()
    }
    if not any(asked.values()):
        known = ", ".join((*asked, *(one.name for problems, _ in FAMILIES.values() for one in problems)))
        raise SystemExit(f"classics: found ONLY={only}, expected one of {known}")
    found: dict[str, dict[str, Row]] = {}
    with ThreadPoolExecutor(PROCESSES) as pool:
        for family, names in ((family, names) for family, names in asked.items() if names):
            rows = pool.map(lambda name, family=family: measured(family, name, limit), names)
            found[family] = dict(zip(names, rows, strict=True))
            print_family(family, found[family])
    write_families(found)
    return int(not all(row["held"] for rows in found.values() for row in rows.values()))


if __name__ == "__main__":
    sys.exit(main())
