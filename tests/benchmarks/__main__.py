"""`make bench`: every figure of the project as one table, measured now on this machine."""

import sys

from rich.console import Console
from rich.table import Table

from tests.benchmarks import engine, mechanisms, motion


def main() -> int:
    """Print the table; 1 if a target is missed."""
    table = Table(title="Benchmarks")
    for heading in ("figure", "measured", "target", "met"):
        table.add_column(heading, justify="left" if heading == "figure" else "right")
    missed = False
    screen = Console()
    with screen.status("measuring") as status:
        for part in (engine.rows(), mechanisms.rows(), motion.rows()):
            for row in part:
                status.update(f"measured {row.figure}")
                verdict = "" if row.met is None else "yes" if row.met else "NO"
                table.add_row(row.figure, row.measured, row.target, verdict)
                missed |= row.met is False
    screen.print(table)
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())
