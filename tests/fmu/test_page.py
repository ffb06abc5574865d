"""The code on the page of the package runs as it stands, block after block."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from tests.site.code_blocks import Page, run_page

PAGE = Path(__file__).parents[2] / "fmu" / "README.md"


@pytest.mark.skipif(not any(map(shutil.which, ("cc", "gcc", "clang"))), reason="no C compiler")
def test_code_of_the_page_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page = Page(PAGE.read_text(encoding="utf-8"))
    run_page(page, PAGE.name)
    names = page.names
    motion, target = names["motion"], np.array(names["target"])
    distance = np.linalg.norm(motion["robot.tool.r"] - target, axis=1)
    assert distance[0] > 0.1  # m: it has a way to go
    assert distance[-1] < 0.1 * distance[0]  # and is nearly there behind its filters
    assert {"fall.png", "motion.png", "system.ssp"} <= {file.name for file in tmp_path.iterdir()}
