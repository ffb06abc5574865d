"""Pages of motions: the fastest one of the six-link robot, slowed down to a second, 60 pictures."""

import sys
from collections.abc import Iterator

from gantrytau import animate
from gantrytau.commands.demo.motion_problems import SixLinks
from gantrytau_optimica import optimize
from tests.benchmarks.table import Row, at_most, in_turn, print_table

ROUNDS = 3


def rows() -> Iterator[Row]:
    """Seconds and megabytes of a page."""
    fastest = optimize(SixLinks, elements=20)
    sizes = list[int]()

    def make() -> None:
        sizes.append(len(animate(fastest, speed=fastest.final_time).text.encode()))

    times = in_turn({"make": make}, ROUNDS)
    figure = "page of a motion of six links, 1 s at 60 pictures"
    yield at_most(f"{figure}: made in", times["make"], 3.0, "s")
    yield at_most(f"{figure}: size", max(sizes) / 1e6, 3.0, "MB")


if __name__ == "__main__":
    sys.exit(print_table("Pages", [rows()]))
