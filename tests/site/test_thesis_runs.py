"""Every figure and table of the thesis on the site: its number, its call, and what the call gives.

The calls are long tests: they are those of the pages, which simulate, learn, calibrate and render.
"""

import matplotlib
import pytest

from notebooks.site.builder.generated.thesis_page import found, thesis_pages
from notebooks.site.builder.places import ROOT
from notebooks.site.builder.thesis_runs import DRAWING, Made, Session, code_before, differences, items

matplotlib.use("Agg")

# what gauges, the accelerometer and the Kalman filter teach: the notebook computes the same and holds Table 7.2
LEARNT = {one for one in items() if "case_3" in code_before(one)}
CALLED = [pytest.param(one, marks=[pytest.mark.nightly] * (one in LEARNT)) for one in items() if one.call]


def test_the_thesis_has_its_figures_and_tables():
    numbers = {kind: [one.number for one in items() if one.kind == kind] for kind in ("figure", "table")}
    assert len(numbers["table"]) == len(set(numbers["table"])) == 19
    assert len(numbers["figure"]) == len(set(numbers["figure"])) == 105
    assert sum(one.why.startswith(DRAWING) for one in items()) == 39
    assert not [one.number for one in items() if not one.call and not one.why]
    assert {one.origin for item in items() for one in item.printed} <= {"found", "given", "assumed", "fitted"}


@pytest.fixture(scope="module")
def session() -> Session:
    return Session()


@pytest.mark.parametrize("item", CALLED, ids=lambda one: f"{one.kind} {one.number}")
def test_calls_of_the_thesis_give_what_it_prints(item, session):
    answer, values = session.run(item)
    figures = answer if isinstance(answer, list) else [answer]
    assert all(hasattr(one, "savefig") for one in figures) or str(answer).strip()
    assert item.kind == "table" or all(hasattr(one, "savefig") for one in figures)
    assert differences(item, values) == []


@pytest.mark.parametrize("item", items(), ids=lambda one: f"{one.kind} {one.number}")
def test_names_of_the_thesis_pages_are_there(item):
    assert item.names or not item.call
    assert all(found(name) is not None for name in item.names)
    assert (ROOT / item.page).exists()


def test_pages_of_the_thesis_show_calls_pictures_and_numbers(tmp_path):
    (item,) = (one for one in items() if (one.kind, one.number) == ("figure", "4.8"))
    picture = tmp_path / "picture.png"
    pages = dict(thesis_pages({item: Made([picture], values=[150.0, 250.0, 200.0])}))
    text = pages["thesis/chapter_4.md"]
    text = text[text.index("### Figure 4.8") : text.index("### Figure 4.9")]
    assert "cases[0].plot()" in text
    assert "![figure 4.8](figure_4_8_0.png)" in text
    assert "| largest | 230 um | 250 um | +8.7 % | found |" in text
    assert "105 figures, of" in pages["thesis/index.md"]
