"""Pages: the fastest motion of the six-link robot, slowed down to a second, its equations; browsers of results."""

import sys
from collections.abc import Iterator

import numpy as np

from gantrytau import Result, animate, browse, simulate, translate
from gantrytau.commands.demo.motion_problems import SixLinks
from gantrytau_models import FourBar, SixLinkGantryTau, prototypes
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
    fall = simulate(FourBar(), stop=2.0)
    large = oscillations()
    for figure, made in (
        ("browser of the 868 variables of a four-bar, which moves beside", lambda: browse(fall)),
        ("browser of 5,000 variables at 5,000 times", lambda: browse(large)),
    ):
        yield at_most(f"{figure}: made in", in_turn({"make": made}, ROUNDS)["make"], 3.0, "s")
        yield at_most(f"{figure}: size", len(made().text.encode()) / 1e6, 15.0, "MB")


def oscillations(count: int = 5000) -> Result:
    """Decaying oscillations of 0.1 rad/s to 40 rad/s for 10 s, with rounding as of a solver."""
    t, random = np.linspace(0.0, 10.0, count), np.random.default_rng(0)
    values = {}
    for k in range(count):
        w, d, phi = 10 ** random.uniform(-1, np.log10(40)), random.uniform(0, 0.3), random.uniform(0, 6)
        wave = random.uniform(0.1, 100) * np.exp(-d * t) * np.sin(w * t + phi)
        values[f"c{k // 50}.v{k}"] = wave + 1e-9 * random.standard_normal(count)
    return Result(t, values, title="oscillations")


if __name__ == "__main__":
    sys.exit(print_table("Pages", [rows()]))
