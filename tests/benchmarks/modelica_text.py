"""Modelica text beside pymoca, a compiler of the same language in Python: parsing, and chains of masses that grow."""

import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from pymoca import parser as pymoca
from pymoca.backends.casadi import generator

from gantrytau import load_modelica, translate
from gantrytau.modelica import SourceText, parse
from tests.benchmarks.table import Row, at_least, at_most, in_turn, print_table, shown

FOLDER = Path(__file__).parents[1] / "modelica"
FILES = ("drive.mo", "functions.mo", "motions.mo")  # what pymoca reads as well
ROUNDS = 5
MASSES = (42, 166, 416, 1666)  # of chains of 500, 2,000, 5,000 and 20,000 variables
OF_PYMOCA = MASSES[:3]  # it takes its time for the last
CHAIN = """package Line
  connector Flange
    Real s(unit="m");
    flow Real f(unit="N");
  end Flange;
  model Mass
    parameter Real m(unit="kg") = 1;
    Flange a, b;
    Real v(unit="m/s");
  equation
    a.s = b.s;
    v = der(a.s);
    m * der(v) = a.f + b.f;
  end Mass;
  model Spring
    parameter Real c(unit="N/m") = 100, d(unit="N.s/m") = 1;
    Flange a, b;
    Real s(unit="m"), f(unit="N"), v(unit="m/s");
  equation
    s = b.s - a.s;
    v = der(s);
    f = c * s + d * v;
    b.f = f;
    a.f = -f;
  end Spring;
  model Wall
    Flange a;
  equation
    a.s = 0;
  end Wall;
  model Chain
    Wall wall;
{parts}
  equation
    connect(wall.a, k1.a);
{joints}
  end Chain;
end Line;
"""


def rows() -> Iterator[Row]:
    """Times of parsing."""
    texts = [SourceText.read(FOLDER / name) for name in FILES]
    programs = {
        "ours": lambda: [parse(text) for text in texts],
        "pymoca": lambda: [pymoca.parse(text.text, bypass_cache=True) for text in texts],
    }
    times = in_turn(programs, ROUNDS)
    yield at_most("Modelica text: parsing of a file", 1e3 * times["ours"] / len(texts), 15.0, "ms")
    yield at_least("Modelica text: time of pymoca, ours 1", round(times["pymoca"] / times["ours"], 1), 10.0)
    yield from _growth()


def _growth() -> Iterator[Row]:
    """Times from text to a system: ours reduces its index, sorts and starts it; pymoca flattens it and makes functions."""
    found, sizes = [], []
    with tempfile.TemporaryDirectory() as folder:
        for count in MASSES:
            file = Path(folder) / f"chain{count}.mo"
            file.write_text(_chain(count), encoding="utf-8")
            begin = time.process_time()
            dae = translate(load_modelica(file)["Line.Chain"]())
            found.append(time.process_time() - begin)
            sizes.append(sum(len(one.elements) for one in dae.flat.variables))
    theirs = []
    for count in OF_PYMOCA:
        begin = time.process_time()
        generator.generate(pymoca.parse(_chain(count), bypass_cache=True), "Line.Chain")
        theirs.append(time.process_time() - begin)
    yield shown("a chain of masses from text, by variables", _curve(sizes, found))
    exponent = np.polyfit(np.log(sizes), np.log(found), 1)[0]
    yield at_most("growth of that, n to the power of", float(exponent), 1.2)
    yield at_most(f"that of {sizes[-1]} variables", found[-1], 8.0, "s")
    yield shown("the same by pymoca, which neither reduces nor sorts", _curve(sizes, theirs))


def _curve(sizes: list[int], times: list[float]) -> str:
    return ", ".join(f"{n}: {t:.2f} s" for n, t in zip(sizes, times, strict=False))


def _chain(count: int) -> str:
    """The text of masses one behind the other, with a spring before each."""
    parts = "\n".join(f"    Spring k{i}; Mass m{i};" for i in range(1, count + 1))
    joints = [f"    connect(k{i}.b, m{i}.a);" for i in range(1, count + 1)]
    joints += [f"    connect(m{i}.b, k{i + 1}.a);" for i in range(1, count)]
    return CHAIN.format(parts=parts, joints="\n".join(joints))


if __name__ == "__main__":
    sys.exit(print_table("Modelica text", [rows()]))
