"""Answers that hold: motions of GT-A refined, played back and searched from several first guesses."""

import time
from collections.abc import Iterator
from time import process_time

import numpy as np

from gantrytau import SolveError
from gantrytau.commands.demo.motion_problems import FreePath, OnLine
from gantrytau_optimica import Optimum, optimize
from tests.benchmarks.peers.six_link import SixLinkMotion
from tests.benchmarks.table import Row, at_most, shown

EXACT_LINE = 0.9737820  # s, by phase-plane integration
LONGEST = 60.0  # s, that a refinement is given here
KNOWN_FREE = 0.9131  # s, of the branch to which the straight line leads


def rows() -> Iterator[Row]:
    """What is left of the errors of refined motions, the faster branch, and what each takes of a processor."""
    yield from _line()
    yield from _free_path()
    yield from _branches()
    yield from _six_links()


def _line() -> Iterator[Row]:
    begin = process_time()
    line = optimize(OnLine, refine=1e-6)
    used = process_time() - begin
    title = "GT-A straight line, refine=1e-6"
    yield at_most(f"{title}, |T - 0.973782 s|", abs(line.final_time - EXACT_LINE), 1e-6, "s")
    yield at_most(f"{title}, limits passed, of their range", line.playback.violation, 1e-6)
    yield at_most(f"{title}, processor", used, 1.0, "s")


def _free_path() -> Iterator[Row]:
    begin = process_time()
    optimize(FreePath)
    plain = process_time() - begin
    title, begin = "GT-A free path, refine=1e-6", process_time()
    try:
        moved = optimize(FreePath, refine=1e-6, max_time=LONGEST)
    except SolveError as error:
        moved = error.optimum
    used = process_time() - begin
    yield shown(title, f"{moved.final_time:.6f} s, {moved.status}")
    yield at_most(f"{title}, processor", used, 8.0, "s")
    yield at_most(f"{title}, processor, of the plain solve", used / plain, 6.0, "x")
    yield at_most("GT-A free path played back, torques over their limit", moved.playback.violation, 1e-4)
    yield at_most("GT-A free path played back, end missed", 1e6 * _missed(moved), 10.0, "um")


def _branches() -> Iterator[Row]:
    begin = time.perf_counter()
    best = optimize(FreePath, starts=8)
    used = time.perf_counter() - begin
    title = "GT-A best of 8 first guesses"
    yield at_most(f"{title}, T over that of the known branch", best.final_time / KNOWN_FREE, 0.95)
    yield shown(title, f"{best.final_time:.5f} s")
    yield at_most(f"{title}, time of the wall", used, 30.0, "s")


def _six_links() -> Iterator[Row]:
    title, begin = "six links D1, refine=1e-4", process_time()
    try:
        moved = optimize(SixLinkMotion, elements=20, refine=1e-4, max_time=LONGEST)
    except SolveError as error:
        yield at_most(f"{title}, not solved: {error.optimum.status}", 1, 0)
        return
    yield at_most(f"{title}, processor", process_time() - begin, 20.0, "s")
    yield at_most(f"{title}, end missed", 1e3 * _missed(moved), 0.1, "mm")
    yield at_most(f"{title}, limits passed, of their range", moved.playback.violation, 1e-3)


def _missed(optimum: Optimum) -> float:
    """Distance in m of the tool from B at the end of the motion as played back."""
    return float(np.linalg.norm(optimum.playback["robot.tool.r"][-1] - optimum.final("robot.tool.r")))


if __name__ == "__main__":
    for row in rows():
        print(row)
