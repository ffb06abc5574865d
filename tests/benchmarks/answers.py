"""Answers that hold: motions of GT-A refined, played back and searched from several first guesses."""

import time
from collections.abc import Iterator

import numpy as np

from gantrytau.commands.demo.motion_problems import FreePath, OnLine
from gantrytau_optimica import Optimum, optimize
from tests.benchmarks.table import Row, at_most, shown

EXACT_LINE = 0.9737820  # s, by phase-plane integration
KNOWN_FREE = 0.9131  # s, of the branch to which the straight line leads


def rows() -> Iterator[Row]:
    """What is left of the errors of refined motions, and the faster branch."""
    free, line = FreePath, OnLine
    begin = time.perf_counter()
    straight = optimize(line, refine=1e-6)
    yield at_most(
        "GT-A straight line refined, |T - 0.973782 s|", abs(straight.final_time - EXACT_LINE), 1e-6, "s"
    )
    yield at_most(
        "GT-A straight line refined, limits passed, of their range", straight.playback.violation, 1e-6
    )
    yield shown("GT-A straight line refined, time", f"{time.perf_counter() - begin:.1f} s")
    begin = time.perf_counter()
    moved = optimize(free, refine=2e-6)
    yield shown("GT-A free path refined", f"{moved.final_time:.6f} s in {time.perf_counter() - begin:.0f} s")
    yield at_most("GT-A free path played back, torques over their limit", moved.playback.violation, 1e-4)
    yield at_most("GT-A free path played back, end missed", 1e6 * _missed(moved), 10.0, "um")
    begin = time.perf_counter()
    best = optimize(free, starts=8)
    yield at_most(
        "GT-A best of 8 first guesses, T over that of the known branch", best.final_time / KNOWN_FREE, 0.95
    )
    yield shown(
        "GT-A best of 8 first guesses", f"{best.final_time:.5f} s in {time.perf_counter() - begin:.0f} s"
    )


def _missed(optimum: Optimum) -> float:
    """Distance in m of the tool from B at the end of the motion as played back."""
    return float(np.linalg.norm(optimum.playback["robot.tool.r"][-1] - optimum.final("robot.tool.r")))


if __name__ == "__main__":
    for row in rows():
        print(row)
