"""The code on the pages of the package, its mechanics and its models runs as it stands, block after block."""

from pathlib import Path

import pytest

from tests.site.code_blocks import blocks, check_page

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
def test_code_of_the_page_runs(page):
    assert "python" in {block.language for block in blocks((ROOT / page).read_text(encoding="utf-8"))}
    check_page(ROOT / page)
