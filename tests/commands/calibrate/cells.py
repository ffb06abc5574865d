"""The example of a cell made small, and what a tracker measures of a robot that a tape measure cannot tell from it."""

import csv
import re
from dataclasses import replace
from typing import Any

import numpy as np

from gantrytau.kinematics import Kinematics
from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import LaserTracker
from gantrytau_optimica.procedure import cell_example

SMALL = {"poses": "poses = 20", "robots": "robots = 2\nspacing = 0.25"}
TAPE = 0.005  # m, as the example says


def with_lines(**lines):
    """The example with some of its lines replaced, by the key at their beginning."""
    text = cell_example()
    for key, line in {**SMALL, **lines}.items():
        text, count = re.subn(
            rf"^(# )?{key} = .*$", line.replace("\\", r"\\"), text, count=1, flags=re.MULTILINE
        )
        assert count == 1, key
    return text


def true_robot():
    """An L1 that a tape measure cannot tell from the nominal one: joints and lengths off by its deviation."""
    off = TAPE * np.random.default_rng(4).standard_normal((3, 4))
    arms = [
        replace(arm, length=arm.length + d[0], offset=tuple(np.add(arm.offset, d[1:])))
        for arm, d in zip(prototypes.L1.arms, off, strict=True)
    ]
    return GantryTau(replace(prototypes.L1, arms=tuple(arms)))


def read_poses(folder):
    """Numbers (k,) and actuators (k, 3) of the poses to be measured."""
    with (folder / "poses.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["measured"] == "1"]
    return [int(row["number"]) for row in rows], np.array(
        [[float(row[f"q{k}"]) for k in (1, 2, 3)] for row in rows]
    )


def measure(folder, rows: Any = slice(None), *, axes=None, change=lambda table: table):
    """Write what a tracker with its own axes, turned by 143 degrees, reads of the true robot at planned poses."""
    _, q = read_poses(folder)
    r, R = Kinematics(true_robot()).fk(q)
    c, s = np.cos(2.5), np.sin(2.5)
    own = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) if axes is None else axes
    tracker = LaserTracker((4.5, 2.9, -0.7), own, target=(0.05, 0.0, 0.0), facing=(1.0, 0.0, 0.0))
    found = tracker.measure(r, R, seed=5, frame="device")
    table = change(np.hstack([q, found.r])[rows])
    file = folder / "measurements.csv"
    with file.open("w", newline="") as opened:
        csv.writer(opened).writerows([["q1", "q2", "q3", "x", "y", "z"], *table.tolist()])
    return file
