"""Pages of the six-link robot: its fastest motion, slowed down to a second, 60 pictures; its equations."""

import sys
from collections.abc import Iterator

from gantrytau import animate, translate
from gantrytau.commands.demo.motion_problems import SixLinks
from gantrytau_models import SixLinkGantryTau, prototypes
from gantrytau_optimica import optimize
from tests.benchmarks.table import Row, at_most, in_turn, print_table

ROUNDS = 3


def rows() -> Iterator[Row]:
    """Seconds and sizes of pages."""
    fastest = optimize(SixLinks, elements=20)
    sizes = list[int]()

    def make() -> None:
        sizes.append(len(animate(fastest, speed=fastest.final_time).text.encode()))

    times = in_turn({"make": make}, ROUNDS)
    figure = "page of a motion of six links, 1 s at 60 pictures"
    yield at_most(f"{figure}: made in", times["make"], 3.0, "s")
    yield at_most(f"{figure}: size", max(sizes) / 1e6, 3.0, "MB")
    equations = translate(SixLinkGantryTau(prototypes.D1)).equations("html")
    yield at_most("page of the equations of six links: size", len(equations.encode()) / 1e3, 300.0, "kB")


if __name__ == "__main__":
    sys.exit(print_table("Pages", [rows()]))
