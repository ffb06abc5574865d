"""The page of results in a real browser: found, ticked, zoomed, read, exported; with the model, and without WebGL."""

import numpy as np
import pytest

from gantrytau import Result, browse, simulate
from gantrytau_models import Pendulum
from tests.viewing.browser import browsing, found

BROWSER = found() or ""
pytestmark = pytest.mark.skipif(not BROWSER, reason="no Chromium or Chrome, apt install chromium")

BLIND = """<body><script>
const known = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
  return kind.startsWith("webgl") ? null : known.call(this, kind, ...more);
};
</script>"""
T = np.array([0.0, 1.0, 2.0, 2.0, 3.0, 4.0])
SAW = np.array([0.0, 1.0, 2.0, -1.0, 0.5, np.nan])


def run(title, factor=1.0):
    return Result(
        T,
        {"a.saw": factor * SAW, "a.turned": T, "b.mode": [0, 0, 0, 1, 1, 1], "b.m": 2.0},
        units={"a.saw": "m", "a.turned": "rad", "b.m": "kg"},
        descriptions={"a.saw": "position of the saw"},
        modes={"b.mode": ("off", "on")},
        held=["b.mode"],
        title=title,
    )


@pytest.fixture(scope="module")
def tab():
    with browsing(BROWSER) as opened:
        opened.resize(1366, 800)
        yield opened


def seen(tab, page, tmp_path):
    """The page in the browser, when it has drawn itself."""
    tab.open(page.save(tmp_path / "page.html"), element="body[data-ready]")
    return tab


def texts(tab, selector):
    return tab.run(f"[...document.querySelectorAll({selector!r})].map(one => one.textContent)")


def test_variables_are_found_ticked_and_read_on_both_sides_of_a_jump(tab, tmp_path):
    seen(tab, browse(run("one"), run("two", 2.0), first=["a.saw", "b.mode"]), tmp_path)
    assert texts(tab, ".row .name") == ["a", "b"]
    tab.run("document.querySelector('.row').click()")
    assert texts(tab, ".row .name") == ["a", "saw", "turned", "b"]
    tab.run("Panels.pin(2.001, 'a')")  # as near as four pixels
    assert texts(tab, ".panel .reading") == ["2 → -1", "4 → -2"]
    assert texts(tab, ".band .reading") == ["= off → on"] * 2
    tab.run("Panels.pin(3, 'b')")
    assert texts(tab, ".panel .reading")[0] == "2 → -1 (Δ 1.5)"
    assert "B − A = 1 s" in texts(tab, "#status")[0]
    tab.run(
        "document.querySelector('#search').value = 'POSITION m'; document.querySelector('#search').oninput()"
    )
    assert texts(tab, ".row .name") == ["a.saw"]
    assert tab.errors == []
    assert [place for place in tab.fetched if not place.startswith(("file:", "about:", "data:"))] == []


def test_dragging_zooms_and_what_is_seen_is_exported(tab, tmp_path):
    seen(tab, browse(run("one"), first=["a.saw", "b.mode"]), tmp_path)
    box = tab.run(
        "(r => [r.left, r.top, r.width])(document.querySelector('.u-over').getBoundingClientRect())"
    )
    tab.drag(box[0] + 0.375 * box[2], box[0] + 0.75 * box[2], box[1] + 40)
    low, high = tab.run("Panels.view")
    assert [low, high] == pytest.approx([1.5, 3.0], abs=0.02)
    tab.run("Panels.zoom([1.5, 3])")
    lines = ["time [s],b.mode,a.saw [m]", "2,0,2", "2,1,-1", "3,1,0.5", ""]
    assert tab.run("Export.table()") == "\n".join(lines)
    assert tab.run("Export.drawing().text").count("<path") == 1
    assert tab.run("Export.picture().then(blob => [blob.type, blob.size > 1000])") == ["image/png", True]
    tab.run("Panels.back(); Panels.back()")
    assert tab.run("Panels.view") is None
    fingers = "[['down', 1, 0.5], ['down', 2, 0.75], ['move', 2, 1]]"  # what is held at both stays under them
    tab.run(
        "(over => {const {left, width} = over.getBoundingClientRect();"
        f"for (const [kind, pointerId, x] of {fingers}) over.dispatchEvent(new PointerEvent('pointer' + kind,"
        "{pointerType: 'touch', pointerId, clientX: left + x * width}))})(document.querySelector('.u-over'))"
    )
    assert tab.run("Panels.view") == pytest.approx([1.0, 3.0], abs=0.02)
    tab.run("Panels.back()")
    tab.run("Panels.against(Data.variables[1])")  # a curve with one gap, at its jump
    tab.until("Panels.panels[0].x?.name === 'a.turned'")
    assert texts(tab, ".below")[0].startswith("a.turned [rad]")
    assert tab.errors == []


@pytest.mark.parametrize("width", [400, 1366, 1920])
def test_nothing_is_wider_than_the_window_and_curves_are_drawn(tab, tmp_path, width):
    tab.resize(width, 800)
    seen(tab, browse(run("one"), run("two", 2.0), first=["a.saw", "b.mode"]), tmp_path)
    tab.rest(0.3)
    assert tab.run("document.documentElement.scrollWidth") <= width
    assert (np.ptp(tab.picture(), axis=2) > 60).sum() > width / 2  # curves cross the panels, two pixels thick
    tab.resize(1366, 800)


def test_the_model_moves_with_the_cursor(tab, tmp_path):
    seen(tab, browse(simulate(Pendulum(), stop=2.0, points=41)), tmp_path)
    tab.until("document.querySelector('iframe').dataset.ready === 'yes'")
    slider = (
        "Number(document.querySelector('iframe').contentDocument.querySelector('[role=slider]').ariaValueNow)"
    )
    tab.run("Panels.pin(1.5, 'a')")
    tab.until(f"Math.abs({slider} - 1.5) < 0.05")
    tab.rest(0.5)
    thumb = tab.run("(r => [r.left, r.top])(document.querySelector('iframe').getBoundingClientRect())")
    rail = tab.run(
        "(r => [r.left, r.top, r.width, r.height])(Element.prototype.getBoundingClientRect.call("
        "document.querySelector('iframe').contentDocument.querySelector('.mantine-Slider-track')))"
    )
    tab.press(thumb[0] + rail[0] + 0.25 * rail[2], thumb[1] + rail[1] + rail[3] / 2)
    tab.until("Math.abs(Panels.a - 0.5) < 0.05")


def test_without_webgl_curves_are_drawn(tab, tmp_path):
    page = browse(simulate(Pendulum(), stop=0.5, points=11))
    file = tmp_path / "blind.html"
    file.write_text(page.text.replace("<body>", BLIND, 1), encoding="utf-8")
    tab.open(file, element="body[data-ready]")
    assert "has no WebGL" in texts(tab, "#scene")[0]
    assert len(texts(tab, ".panel")) > 0


def test_what_is_beyond_its_limits_is_marked_listed_and_shaded(tab, tmp_path):
    limited = Result(
        T, {"a.turned": T, "a.held": T}, limits={"a.turned": (-np.inf, 2.5)}, units={"a.turned": "rad"}
    )
    seen(tab, browse(limited, first=["a.turned"], display={"a.turned": "rad"}), tmp_path)
    tab.run("document.querySelector('#search').value = 'beyond'; document.querySelector('#search').oninput()")
    assert texts(tab, ".row .name") == ["a.turned"]
    words = "beyond its max of 2.5 rad from t = 2.5 s, by up to 1.5 rad"
    assert words in tab.run("document.querySelector('.row').title")
    assert tab.run("document.querySelector('.entry .beyond').title") == words
    stretches = "Curves.beyond(Panels.panels[0].curves[0], 0, 4)"
    assert tab.run(stretches) == [[3, 4]]
