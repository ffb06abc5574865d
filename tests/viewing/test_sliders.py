"""Poses on sliders, against the triangle that closes a four-bar."""

import numpy as np
import pytest

from gantrytau import InitializationError, ModelError, translate, view
from gantrytau.viewing.sliders import Posing
from gantrytau_models import FourBar, GantryTau, Pendulum, prototypes

LENGTHS = (1.0, 0.3, 1.0, 0.9)  # ground, crank, coupler, rocker, m


@pytest.fixture(scope="module")
def bar():
    return translate(FourBar(*LENGTHS))


def test_loops_close_at_all_choices_that_can_be(bar):
    ground, _, coupler, rocker = LENGTHS
    posing = Posing(bar, {"crank.phi": ("0 deg", "180 deg"), "crank.length": (0.3, 2.0)}, {}, None, ())
    poses = posing.everywhere()
    angles, lengths = (slider.values for slider in posing.sliders)
    phi, crank = np.meshgrid(angles, lengths, indexing="ij")
    # what coupler and rocker bridge
    gap = np.hypot(ground - crank * np.cos(phi), crank * np.sin(phi)).ravel()
    apart = (gap > coupler + rocker + 1e-6) | (gap < abs(coupler - rocker) - 1e-6)
    assert np.all(poses.failed[apart])
    assert (~poses.failed).sum() > 0.9 * (~apart).sum() > 0
    ends = [poses.film.values(f"{bar_}.rod.frame_b.r", (3,)) for bar_ in ("coupler", "rocker")]
    begins = [poses.film.values(f"{bar_}.rod.frame_a.r", (3,)) for bar_ in ("coupler", "rocker")]
    for begin, end, length in zip(begins, ends, (coupler, rocker), strict=True):
        assert np.linalg.norm(end - begin, axis=1) == pytest.approx(length, abs=1e-9)
    assert 0 < len(poses.reasons) <= 4
    assert all("open" in words or "off by" in words for words in poses.reasons.values())


def test_the_start_is_one_of_the_places(bar):
    (slider,) = Posing(bar, True, {}, None, ()).sliders
    assert slider.name == "crank.phi"
    assert slider.values[slider.start] == bar.evaluate()["crank.phi"]
    assert np.ptp(slider.values) == pytest.approx(2 * np.pi)


def test_two_ways_to_assemble_it(bar):
    starts = {"up": {"rocker.phi": 1.5}, "down": {"rocker.phi": -1.5}}
    poses = Posing(bar, ["crank.phi"], {}, starts, ()).everywhere()
    heights = poses.film.values("rocker.rod.frame_b.r", (3,))[:, 2].reshape(2, -1)
    assert poses.assemblies == ("up", "down")
    assert np.all(heights[0] > 0)
    assert np.all(heights[1] < 0)


def test_coordinates_that_are_not_moved_stay():
    posing = Posing(translate(GantryTau(prototypes.L1)), {"tool.r[0]": (0.3, 0.6)}, {}, None, ())
    tool = posing.everywhere().film.values("tool.body.frame_a.r", (3,))
    assert np.ptp(tool, axis=0) == pytest.approx([0.3, 0, 0], abs=1e-9)


def test_a_live_page_says_what_cannot_be(bar):
    with view(bar, sliders={"crank.length": (0.1, 4.0)}, live=True) as page:
        page.set({"crank.length": "25 cm"})
        assert (page.pose, page.why) == ({"crank.length": pytest.approx(0.25)}, "")
        page.set({"crank.length": 3.9})
        assert "open" in page.why or "off by" in page.why
        assert page.url.startswith("http://127.0.0.1:")
        with pytest.raises(ModelError, match="did you mean"):
            page.set({"crank.lenght": 1.0})


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"sliders": ["crank.fi"]}, "did you mean 'crank.phi'"),
        ({"sliders": ["crank.rod.frame_b.r"]}, "expected a scalar"),
        ({"sliders": []}, "expected names, or ranges"),
        ({"sliders": {"crank.phi": 3}}, "the lowest and the highest"),
        ({"sliders": {"crank.phi": (2, 1)}}, "above 2"),
        ({"sliders": ["crank.phi", "rocker.phi"]}, "mobility"),
        (
            {"sliders": ["crank.phi", "crank.length", "coupler.length", "rocker.length", "ground"]},
            "live=True",
        ),
        ({"sliders": True, "configurations": [1]}, "start values by name"),
        ({"live": True, "file": "x.html"}, "served, not saved"),
    ],
)
def test_wrong_sliders_are_told(bar, options, words):
    with pytest.raises(ModelError, match=words):
        view(bar, **options)


def test_nothing_that_can_be(bar):
    with pytest.raises(InitializationError, match=r"off by|open"):
        view(bar, sliders={"crank.length": (5.0, 6.0)})


def test_a_page_holds_its_sliders():
    text = view(Pendulum(), sliders={"x": None}).text
    assert '"name": "x"' in text
