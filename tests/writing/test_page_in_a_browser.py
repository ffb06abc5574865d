"""The page of equations in a real browser: nothing is wider than the window, and its links arrive."""

import pytest

from gantrytau import translate
from gantrytau_models import FourBar, GantryTau, SixLinkGantryTau, prototypes
from tests.viewing.browser import browsing, found

BROWSER = found() or ""
pytestmark = pytest.mark.skipif(not BROWSER, reason="no Chromium or Chrome, apt install chromium")
WIDTH = 1000  # pixels


@pytest.fixture(scope="module")
def tab():
    with browsing(BROWSER) as opened:
        opened.resize(WIDTH, 800)
        yield opened


def opened(tab, dae, tmp_path):
    """The page of a model in the browser."""
    file = tmp_path / "equations.html"
    file.write_text(dae.equations("html"), encoding="utf-8")
    tab.open(file, element="dl")
    return tab


@pytest.fixture(scope="module")
def six():
    return translate(SixLinkGantryTau(prototypes.D1))


@pytest.mark.parametrize("name", ["four bars", "six links", "inverse kinematics"])
def test_nothing_is_wider_than_the_window(tab, six, name, tmp_path):
    dae = {
        "four bars": lambda: translate(FourBar()),
        "six links": lambda: six,
        "inverse kinematics": lambda: translate(
            GantryTau(prototypes.L1), given=["tool.r"], find=["carts[0].s"]
        ),
    }[name]()
    opened(tab, dae, tmp_path)
    tab.run("window.onbeforeprint()")
    assert tab.run("document.querySelectorAll('details:not([open])').length") == 0
    assert tab.run("document.documentElement.scrollWidth") <= WIDTH
    assert tab.errors == []
    assert [place for place in tab.fetched if not place.startswith(("file:", "about:"))] == []


def test_a_name_leads_to_its_row_and_explains_itself(tab, six, tmp_path):
    opened(tab, six, tmp_path)
    link = "[...document.querySelectorAll('p a')].find(a => a.textContent == 'arms[0].links[0].rod.tension')"
    tab.run(f"{link}.dispatchEvent(new MouseEvent('mouseover', {{ bubbles: true }}))")
    title = (
        "arms[0].links[0].rod.tension [N/m]: force along the rod, divided by its length; positive when pulled"
    )
    assert tab.run(f"{link}.title") == title
    row = f"document.querySelector({link}.hash)"
    assert not tab.run(f"{row}.closest('details').open")
    tab.run(f"{link}.click()")
    tab.until(f"{row}.closest('details').open")
    tab.until(f"{row}.getBoundingClientRect().top < 800 && {row}.getBoundingClientRect().top >= 0")


def test_names_are_found_in_the_page_as_they_are_written(tab, six, tmp_path):
    opened(tab, six, tmp_path)
    for name in ("arms[0].links[0].rod.frame_b.f", "carts[2].law.f_c", "tool.r"):
        assert tab.run(f"window.find({name!r})"), name
    assert not tab.run("window.find('arms[7].links')")
