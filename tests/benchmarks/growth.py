"""How the minimum-time motion GT-A grows with the number of elements, beside programs by hand, with Opti and with rockit."""

import json
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np

from gantrytau import SolveError
from gantrytau.commands.demo.motion_problems import FreePath
from gantrytau_optimica import prepare
from tests.benchmarks.gta import Task
from tests.benchmarks.peers import by_hand, three_link, with_opti
from tests.benchmarks.peers.written import Outcome
from tests.benchmarks.pose_sweep import fastest, pairs, prepared
from tests.benchmarks.table import Row, at_most, peak_memory, print_table, shown

ELEMENTS = (25, 50, 100, 200, 400)
PEER_TIME = 15.0  # s that a peer may take for all of them
LARGE = 2230  # elements: 100,000 variables
LARGE_TIME = 30.0  # s for Ipopt
PAIRS, COMPARED = 60, 10

Program = Callable[[int, float], Outcome]  # elements, s for Ipopt -> what it took


def rows() -> Iterator[Row]:
    """All figures of growth."""
    yield from _growth("model", from_components, 60.0)
    peers = {"by hand": by_hand.solve, "Opti": with_opti.solve}
    try:
        from tests.benchmarks.peers import with_rockit
    except ImportError:
        yield shown("GT-A, rockit", "not installed")
    else:
        peers["rockit"] = with_rockit.solve
    for title, solve in peers.items():
        yield from _growth(title, lambda n, _, solve=solve: solve(three_link.motion, n), PEER_TIME)
    yield from _large()
    yield from _pose_pairs()


def from_components(elements: int, max_time: float) -> Outcome:
    """The motion from components; building begins with the translation of the robot."""
    begin = time.process_time()
    prepared = prepare(FreePath, elements=elements, max_time=max_time)
    built = time.process_time()
    try:
        optimum = prepared.solve()
    except SolveError as error:
        optimum = error.optimum
    return Outcome(
        optimum.final_time,
        optimum.iterations,
        built - begin,
        time.process_time() - built,
        optimum.success,
        prepared.program.places.size,
    )


def _growth(title: str, program: Program, limit: float) -> Iterator[Row]:
    """One program on finer and finer meshes, until its seconds would not do for the next."""
    found: dict[int, Outcome] = {}
    spent = last = 0.0
    for elements in ELEMENTS:
        figure = f"GT-A, {title}, {elements} elements"
        if spent + 2 * last > limit:
            yield shown(figure, f"stopped: {limit:g} s for all sizes")
            break
        begin = time.perf_counter()
        try:
            outcome = program(elements, limit - spent)
        except RuntimeError:
            outcome = None
        last = time.perf_counter() - begin
        spent += last
        if outcome is None or not outcome.success:
            yield shown(figure, f"stopped after {last:.1f} s without a solution")
            break
        found[elements] = outcome
        yield shown(figure, _words(outcome))
    if len(found) > 2:
        yield shown(f"GT-A, {title}, growth with the elements n", _exponents(found))


def _words(outcome: Outcome) -> str:
    times = f"{outcome.build:.2f} + {outcome.solve:.2f} s"
    return f"{times}, {outcome.iterations} iterations, {outcome.variables} unknowns"


def _exponents(found: dict[int, Outcome]) -> str:
    def exponent(times: list[float]) -> str:
        return f"n^{np.polyfit(np.log(list(found)), np.log(times), 1)[0]:.1f}"

    build = exponent([outcome.build for outcome in found.values()])
    solve = exponent([outcome.solve for outcome in found.values()])
    each = exponent([outcome.solve / outcome.iterations for outcome in found.values()])
    return f"build {build}, solve {solve}, an iteration {each}"


def _large() -> Iterator[Row]:
    """One problem of 100,000 variables, in a process of its own so that its memory is its own."""
    command = [sys.executable, "-c", "from tests.benchmarks import growth; growth.measure_large()"]
    child = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    found = json.loads(child.stdout.splitlines()[-1])
    figure = f"GT-A, {found['variables']} unknowns"
    yield at_most(f"{figure}, build", found["build"], 15.0, "s")
    if "memory" in found:
        yield at_most(f"{figure}, peak memory, solving included", found["memory"], 4.0, "GB")
    each = found["solve"] / max(found["iterations"], 1)
    ended = "solved in" if found["success"] else "not solved in"
    words = f"{ended} {found['solve']:.0f} s: {found['iterations']} iterations of {each:.2f} s"
    yield shown(f"{figure}, solve", words)


def measure_large(max_time: float = LARGE_TIME) -> None:
    """Build and solve the large problem; one line of JSON with what it took (s, GB)."""
    outcome = from_components(LARGE, max_time)
    found = {
        name: getattr(outcome, name) for name in ("variables", "build", "solve", "iterations", "success")
    }
    with suppress(ImportError):  # Windows
        found["memory"] = peak_memory()
    print(json.dumps(found))


def _pose_pairs() -> Iterator[Row]:
    """Random pairs of poses, every sixth beside the program by hand in the same minute; times of the processor."""
    seconds, mine, theirs, missed = [], [], [], 0
    begin = time.process_time()
    prepared(50)  # the program is built before its first motion
    build = time.process_time() - begin
    for k, (start, end) in enumerate(pairs(PAIRS, seed=0)):
        begin = time.process_time()
        verdict = fastest(start, end)
        spent = time.process_time() - begin
        missed += not verdict.success
        seconds.append(spent)
        if k % (PAIRS // COMPARED) == 0:
            mine.append(spent)
            task = replace(Task(), start=verdict.start, end=verdict.end)
            theirs.append(by_hand.solve(partial(three_link.motion, task), 50))
    yield at_most(f"pose pairs that do not converge, of {PAIRS}", missed, 0)
    share = build / PAIRS
    yield shown("pose pairs, median time, built once", f"{share + statistics.median(seconds):.3f} s")
    built_once = statistics.fmean(outcome.build for outcome in theirs) / PAIRS
    hand = built_once + statistics.median(outcome.solve for outcome in theirs)
    figure = f"{COMPARED} of these pairs against by hand, both built once"
    yield at_most(figure, (share + statistics.median(mine)) / hand, 1.3, "x")
    lost = sum(not outcome.success for outcome in theirs)
    yield shown(f"of these {COMPARED}, by hand: median, not converged", f"{hand:.3f} s, {lost}")


if __name__ == "__main__":
    sys.exit(print_table("Growth", [rows()]))
