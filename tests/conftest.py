"""The order of files: the longest first, so that no worker is left with one of them when the others have ended."""

from pathlib import Path

import pytest

TESTS = Path(__file__).parent
LONGEST = (  # twenty seconds of one processor and more; test_compiling.py takes minutes where zig's cache is empty
    "fmu/test_compiling.py",
    "test_notebooks.py",
    "fmu/test_singular_poses.py",
    "models/test_tracking.py",
    "models/test_f1.py",
    "fmu/test_clients.py",
    "models/test_six_link.py",
    "models/test_stewart.py",
    "fmu/test_parameters.py",
    "mechanics/test_crossing_assemblies.py",
    "cli/test_simulate.py",
    "models/test_four_bar.py",
    "fmu/test_fuzz.py",
    "test_simulation.py",
    "mechanics/test_loops.py",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    place = {TESTS / file: k for k, file in enumerate(LONGEST)}
    # a stable sort: the others keep their order
    items.sort(key=lambda item: place.get(item.path, len(place)))
