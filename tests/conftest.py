"""The order of files: the longest first, so that no worker is left with one of them when the others have ended."""

from pathlib import Path

import pytest

TESTS = Path(__file__).parent
LONGEST = (  # twenty seconds of one processor and more; test_compiling.py takes minutes where zig's cache is empty
    "fmu/building/test_compiling.py",
    "notebooks/test_notebooks.py",
    "fmu/runtime/test_singular_poses.py",
    "models/control/test_tracking.py",
    "models/mechanisms/test_f1.py",
    "fmu/test_clients.py",
    "models/mechanisms/test_six_link.py",
    "models/mechanisms/test_stewart.py",
    "fmu/runtime/test_parameters.py",
    "mechanics/multibody/test_crossing_assemblies.py",
    "commands/test_simulate.py",
    "models/mechanisms/test_four_bar.py",
    "fmu/runtime/test_fuzz.py",
    "simulation/test_simulation.py",
    "mechanics/multibody/test_loops.py",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    place = {TESTS / file: k for k, file in enumerate(LONGEST)}
    # a stable sort: the others keep their order
    items.sort(key=lambda item: place.get(item.path, len(place)))
