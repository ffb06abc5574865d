"""The order of files: the longest first, so that no worker is left with one of them when the others have ended."""

import gc
import os
import signal
from collections import Counter
from pathlib import Path

import hypothesis
import pytest

from tests.families import NIGHTLY

TESTS = Path(__file__).parent
# no compilers beside the tests; those of kernels have folders of their own
os.environ["GANTRYTAU_CACHE"] = "off"
LONGEST = (  # ten seconds of one processor and more; test_compiling.py takes minutes where zig's cache is empty
    "fmu/building/test_compiling.py",
    "notebooks/test_notebooks.py",
    "optimica/vision/detection/test_detect.py",
    "optimica/known_answers/test_closed_loops.py",
    "commands/calibrate/test_calibrate_cell.py",
    "fmu/runtime/test_singular_poses.py",
    "commands/calibrate/test_calibrate_verdict.py",
    "viewing/test_in_a_browser.py",
    "commands/test_new.py",
    "models/mechanisms/test_f1.py",
    "optimica/procedure/test_plan.py",
    "models/mechanisms/test_stewart.py",
    "fmu/test_clients.py",
    "fmu/runtime/test_fuzz.py",
    "models/mechanisms/test_delta.py",
    "mechanics/multibody/test_crossing_assemblies.py",
    "mechanics/multibody/test_loops.py",
    "optimica/calibration/test_turning.py",
    "optimica/known_answers/test_gantry.py",
    "models/mechanisms/test_six_link.py",
    "optimica/estimation/test_estimation.py",
    "models/control/test_tracking.py",
    "fmu/reading/test_checking.py",
    "optimica/procedure/test_resuming.py",
    "models/test_pages.py",
    "site/test_code_blocks.py",
    "models/mechanisms/test_four_bar.py",
    "fmu/runtime/test_sanitizers.py",
    "fmu/runtime/test_switching.py",
    "fmu/runtime/test_whens.py",
    "fmu/runtime/test_delay.py",
    "optimica/refinement/test_refinement.py",
    "optimica/calibration/design/test_pose_selection.py",
    "writing/test_modelica_models.py",
    "optimica/procedure/test_fresh_robots.py",
    "fmu/runtime/test_parameters.py",
    "optimica/paths/test_path_motions.py",
    "models/mechanisms/test_wrist.py",
    "models/control/test_feedforward.py",
    "kinematics/test_kinematics_of_models.py",
    "optimica/known_answers/test_mechanisms.py",
)

# a shell starts what runs in its background deaf to Ctrl-C, which some tests press
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# nothing may depend on how busy the machine is
hypothesis.settings.register_profile(
    "any machine", deadline=None, suppress_health_check=[hypothesis.HealthCheck.too_slow]
)
hypothesis.settings.load_profile("any machine")


LONG_TESTS = TESTS / "long_tests.txt"
LONG = 1.5  # s of one processor from which a test is a long one


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--only", choices=["short", "long"], help="tests that tests/long_tests.txt does not name, or does"
    )
    parser.addoption(
        "--renew-long-tests", action="store_true", help="write tests/long_tests.txt from a run of all tests"
    )


def function_of(nodeid: str) -> str:
    """A line of the list of long tests: a file, relative to this folder, and the function in it."""
    return nodeid.partition("[")[0].removeprefix("tests/")


def pytest_terminal_summary(terminalreporter, config: pytest.Config) -> None:
    if config.getoption("renew_long_tests"):
        seconds = Counter[str]()
        for report in (report for reports in terminalreporter.stats.values() for report in reports):
            if hasattr(report, "duration"):  # the set-up, the call or the end of a test
                seconds[report.nodeid] += report.duration
        LONG_TESTS.write_text(
            "".join(f"{name}\n" for name in sorted({function_of(k) for k in seconds if seconds[k] > LONG}))
        )


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if only := config.getoption("only"):
        long = set(LONG_TESTS.read_text().split())
        wanted = [(function_of(item.nodeid) in long) == (only == "long") for item in items]
        config.hook.pytest_deselected(
            items=[item for item, kept in zip(items, wanted, strict=True) if not kept]
        )
        items[:] = [item for item, kept in zip(items, wanted, strict=True) if kept]
    if not NIGHTLY:
        config.hook.pytest_deselected(items=[item for item in items if item.get_closest_marker("nightly")])
        items[:] = [item for item in items if not item.get_closest_marker("nightly")]
    place = {TESTS / file: k for k, file in enumerate(LONGEST)}
    # a stable sort: the others keep their order
    items.sort(key=lambda item: place.get(item.path, len(place)))


def pytest_collection_finish() -> None:
    """What was imported stays to the end: a collection that looks through it takes a tenth of a translation's time."""
    gc.freeze()
