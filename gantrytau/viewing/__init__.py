"""Pictures of models: what their components look like, in a pose or in motion, on one page for any browser.

`view` and `animate` stand in `gantrytau`; here are the shapes that a method `shapes()` yields.
"""

from gantrytau.language.self_description.appearance import (
    Ball,
    Cloud,
    Cuboid,
    ForceArrow,
    Hinge,
    Lump,
    MeshFile,
    PathLine,
    RoundBar,
    Slideway,
    Stick,
    Triad,
)
from gantrytau.viewing.packed_runs import LARGEST

__all__ = [
    "LARGEST",
    "Ball",
    "Cloud",
    "Cuboid",
    "ForceArrow",
    "Hinge",
    "Lump",
    "MeshFile",
    "PathLine",
    "RoundBar",
    "Slideway",
    "Stick",
    "Triad",
]
