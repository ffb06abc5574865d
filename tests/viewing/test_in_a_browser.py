"""Pages in a real browser: no errors, nothing fetched, something drawn, and the slider moves it."""

import numpy as np
import pytest

from gantrytau import animate, simulate, view
from gantrytau.commands.demo.motion_problems import SixLinks
from gantrytau_models import FourBar, GantryTau, Pendulum, prototypes
from gantrytau_optimica import optimize
from tests.viewing.browser import browsing, found

BROWSER = found() or ""
pytestmark = pytest.mark.skipif(
    not BROWSER, reason="no Chromium or Chrome is installed, apt install chromium"
)

THUMB = "document.querySelector('[role=slider]')"
DRAWN = 0.005  # of the window: a rod alone has more


@pytest.fixture(scope="module")
def tab():
    with browsing(BROWSER) as opened:
        yield opened


def seen(tab, page, tmp_path):
    """A page in the browser, when it has drawn itself."""
    tab.open(page.save(tmp_path / "page.html"))
    tab.quieten()
    return tab


def afar(tab):
    """What pages asked the network for."""
    return [place for place in tab.fetched if not place.startswith(("file:", "data:", "blob:", "about:"))]


def coloured(picture):
    """Where there is neither white nor grey."""
    return np.ptp(picture, axis=2) > 40


def above_the_slider(picture):
    """The rows of the picture in which there is only the model."""
    return picture[: int(0.85 * len(picture))]


def reddish(picture):
    """Where a part is at a limit."""
    return (picture[..., 0] > 120) & (picture[..., 1] < 50) & (picture[..., 2] < 50)


def test_a_fastest_motion_plays(tab, tmp_path):
    seen(tab, animate(optimize(SixLinks, elements=8)), tmp_path)
    tab.pause()
    first = tab.picture_at(0.05)
    begin = float(tab.run(f"{THUMB}.ariaValueNow"))
    again = tab.picture_at(0.05)
    last = tab.picture_at(0.95)
    end = float(tab.run(f"{THUMB}.ariaValueNow"))
    longest = float(tab.run(f"{THUMB}.ariaValueMax"))
    assert [begin / longest, end / longest] == pytest.approx([0.05, 0.95], abs=0.03)  # pixels, and sixtieths
    assert coloured(above_the_slider(first)).mean() > DRAWN
    assert reddish(first).any()  # carts start with the whole of their force
    moved = above_the_slider(np.abs(first - last)).max(axis=2) > 40
    stayed = above_the_slider(np.abs(first - again)).max(axis=2) > 40
    assert moved.mean() > DRAWN
    assert stayed.mean() < 0.1 * moved.mean()
    assert tab.errors == []
    assert afar(tab) == []


def test_a_pose_is_drawn_whole(tab, tmp_path):
    seen(tab, view(GantryTau(prototypes.L1), {"tool.r": [0.5, 3.0, -0.6]}), tmp_path)
    drawn = coloured(tab.picture())  # a pose has no slider
    assert drawn.mean() > DRAWN
    edges = np.concatenate([drawn[0], drawn[-1], drawn[:, 0], drawn[:, -1]])
    assert not edges.any()  # nothing is cut off
    assert float(tab.run(f"{THUMB}.ariaValueMax")) == 0.0  # a slider that is not shown
    assert tab.errors == []


def test_two_motions_stand_apart(tab, tmp_path):
    swings = [simulate(Pendulum(damping=d), stop=2.0, points=41) for d in (0.0, 1.0)]
    seen(tab, animate(swings, names=["free", "damped"]), tmp_path)
    columns = coloured(above_the_slider(tab.picture())).any(axis=0)
    gaps = np.diff(np.flatnonzero(columns))
    assert gaps.max() > 5  # pixels without anything between them
    assert tab.errors == []
    assert afar(tab) == []  # fonts of the names


def test_a_notebook_shows_it_in_a_frame(tab, tmp_path):
    page = animate(simulate(Pendulum(), stop=0.5, points=11))
    (tmp_path / "cell.html").write_text(f"<!doctype html><body>{page._repr_html_()}</body>", encoding="utf-8")
    tab.open(tmp_path / "cell.html", "document.querySelector('iframe').contentDocument")
    tab.rest(2.5)
    assert coloured(above_the_slider(tab.picture())).mean() > 0.1 * DRAWN
    assert tab.errors == []


def test_sliders_put_a_model_into_poses(tab, tmp_path):
    page = view(FourBar(), sliders={"crank.phi": None, "crank.length": (0.3, 1.8)})
    tab.open(page.save(tmp_path / "page.html"), element="body[data-ready]")
    tab.rest(1.0)
    begin = tab.picture()
    for place, wanted in ((0, 2), (1, 30)):
        tab.run(
            f"(e => {{ e.value = {wanted}; e.dispatchEvent(new Event('input')); }})"
            f"(document.querySelectorAll('input[type=range]')[{place}])"
        )
    tab.rest(1.5)
    end = tab.picture()
    assert "cannot be" in tab.run("document.getElementById('said').textContent")
    assert reddish(begin).sum() == 0
    assert reddish(end).mean() > DRAWN / 2
    assert (tab.errors, afar(tab)) == ([], [])
