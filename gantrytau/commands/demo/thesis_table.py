"""Table 3.1 of Dressler (2012): its motions, printed figures, and those found here beside them."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.table import Table

    from gantrytau_optimica import Optimum


@dataclass(frozen=True)
class ThesisMotion:
    """One row of Table 3.1 (Dressler 2012): title, energy weight, and its printed time and energy."""

    key: str
    title: str
    weight: float
    line: bool
    thesis_time: float
    thesis_energy: float


ROWS = (
    ThesisMotion("free_w0", "free path, w = 0", 0.0, False, 0.9074, 103.84),
    ThesisMotion("free_w0001", "free path, w = 0.001", 0.001, False, 0.9191, 77.00),
    ThesisMotion("free_w001", "free path, w = 0.01", 0.01, False, 0.9968, 50.13),
    ThesisMotion("line_w0", "straight line, w = 0", 0.0, True, 0.97612, 57.33),
)


STARTS = 2  # first guesses, of which one leads to a faster branch
BRANCH, BRANCH_TITLE = "free_branch", "free, best branch"
SIX_LINK, SIX_LINK_TITLE = "six_link", "six links, robot D1"
WHY = "A, B and torque limit, not printed in the thesis, are fitted: hence not 0.9074 s."
WHICH = f"The best branch of {STARTS} first guesses solves the same problem as the first row."


def summary(row: ThesisMotion, optimum: "Optimum", seconds: float) -> dict[str, Any]:
    """The figures of one row, as numbers; seconds: what the whole call took."""
    return {
        **figures(row.title, optimum, seconds),
        "energy": optimum.integral("square"),
        "thesis_time": row.thesis_time,
        "thesis_energy": row.thesis_energy,
    }


def figures(title: str, optimum: "Optimum", seconds: float) -> dict[str, Any]:
    """What is told of a motion that the thesis does not have."""
    refinement = optimum.refinement
    return {
        "row": title,
        "time": optimum.final_time,
        "refined": refinement is not None and refinement.reached,
        "violation": optimum.playback.violation,
        "seconds": seconds,
    }


def table(summaries: list[dict[str, Any]]) -> "Table":
    """The rows beside Table 3.1 of the thesis, then those that it does not have."""
    from rich.box import SIMPLE
    from rich.table import Table

    found = Table(title="Minimum-time motions, those of the L1 beside Table 3.1 of the thesis", box=SIMPLE)
    found.add_column("motion", no_wrap=True)
    for heading in ("T (s)", "energy", "thesis T", "energy", "took (s)"):
        found.add_column(heading, justify="right")
    for row in summaries:
        found.add_row(
            row["row"],
            f"{row['time']:.5f}",
            _cell(row, "energy", ".2f"),
            _cell(row, "thesis_time", ".4f"),
            _cell(row, "thesis_energy", ".2f"),
            f"{row['seconds']:.1f}",
        )
    return found


def _cell(row: dict[str, Any], name: str, form: str) -> str:
    return format(row[name], form) if name in row else "-"
