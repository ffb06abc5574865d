"""The code on the pages of the package, its mechanics and its models runs as it stands, block after block."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    "page",
    [
        "gantrytau/README.md",
        "gantrytau/ensembles/README.md",
        "gantrytau/mechanics/README.md",
        "gantrytau/blocks/README.md",
        "gantrytau/electrical/README.md",
        "models/README.md",
    ],
    ids=str,
)
def test_code_of_the_page_runs(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(), re.DOTALL)
    assert blocks
    names: dict[str, object] = {}
    for block in blocks:
        exec(compile(block, page, "exec"), names)
