"""How wide cells are of which so many fill a volume, a box, a workspace."""

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau.kinematics import Kinematics, Limits, grid_spacing, workspace
from gantrytau_models import GantryTau, SixLinkGantryTau, prototypes

LIMITS = Limits(strokes=(0.0, 1.5), ball_joint=0.7)


@pytest.fixture(scope="module")
def l1() -> Kinematics:
    return Kinematics(GantryTau(prototypes.L1))


@pytest.mark.parametrize("places", [1, 8, 1000, 1_000_000])
def test_so_many_cells_fill_the_volume(places):
    assert places * grid_spacing(places, 2.0) ** 3 == pytest.approx(2.0)
    assert places * grid_spacing(places, 2.0, dimensions=2) ** 2 == pytest.approx(2.0)
    assert places * grid_spacing(places, 2.0, dimensions=1) == pytest.approx(2.0)
    box = [[0.0, 2.0], [-1.0, 1.0], [0.5, 1.0]]
    assert grid_spacing(places, box) == pytest.approx(grid_spacing(places, 2.0))
    box[2] = [0.5, 0.5]
    assert grid_spacing(places, box) == pytest.approx(grid_spacing(places, 4.0, dimensions=2))
    assert grid_spacing(places, box, dimensions=2) == grid_spacing(places, box)


def test_a_cube_is_cut_into_the_places_that_are_asked(l1):
    # places inside a cube within the workspace are all inside
    box = [[0.45, 0.55], [2.95, 3.05], [-0.65, -0.55]]
    for side in (4, 7, 10):
        found = workspace(l1, Limits(), box=box, places=side**3)
        assert found.shape == (side, side, side)
        assert len(found.places) == side**3
        assert found.spacing == pytest.approx(0.1 / side)


@pytest.mark.parametrize("places", [300, 3000, 30_000])
def test_about_as_many_are_inside_as_were_asked(l1, places):
    found = workspace(l1, LIMITS, places=places)
    # whole cells along three axes, with some 7 to 40 of them each: a few per cent
    assert len(found.places) == pytest.approx(places, rel=0.08)
    cell = (found.extent / found.shape).prod()
    assert len(found.places) * cell == pytest.approx(found.volume)


def test_a_look_foretells_a_finer_grid(l1):
    rough = workspace(l1, LIMITS, spacing=0.1, refine=3)
    spacing = grid_spacing(20_000, rough)
    assert 20_000 * spacing**3 == pytest.approx(rough.volume)
    assert len(workspace(l1, LIMITS, spacing=spacing).places) == pytest.approx(20_000, rel=0.1)


def test_a_slice_and_a_single_place(l1):
    found = workspace(l1, LIMITS, box=[[1.2, 1.2], [1.0, 5.0], [-2.5, 1.5]], places=500)
    assert found.dimensions == 2
    assert len(found.places) == pytest.approx(500, rel=0.08)
    assert grid_spacing(500, found) ** 2 == pytest.approx(found.area / 500)
    one = workspace(l1, LIMITS, box=[[1.2, 1.2], [3.0, 3.0], [-0.6, -0.6]], places=10)
    assert one.shape == (1, 1, 1)
    assert one.spacing == 0.0


def test_a_box_without_a_place_inside_ends(l1):
    found = workspace(l1, LIMITS, box=[[0, 1], [20, 21], [0, 1]], places=100)
    assert not len(found.places)
    with pytest.raises(ModelError, match="with nothing inside, expected a size above 0"):
        grid_spacing(100, found)


def test_other_robots_have_so_many_places_too():
    found = workspace(SixLinkGantryTau(prototypes.D1), Limits(strokes=(0.5, 1.3)), places=400)
    assert len(found.places) == pytest.approx(400, rel=0.1)


def test_what_is_no_number_of_places_is_refused(l1):
    with pytest.raises(ModelError, match="found places"):
        grid_spacing(10**400, 1.0)
    for of in (0.0, -1.0, [[1, 0], [0, 1], [0, 1]], np.zeros((3, 2))):
        with pytest.raises(ModelError, match="expected a size above 0, a box") as caught:
            grid_spacing(10, of)
        assert caught.value.argument == "of"
    with pytest.raises(ModelError, match="found dimensions=2, expected 3, as it has"):
        grid_spacing(10, np.array([[0, 1]] * 3), dimensions=2)
    with pytest.raises(ModelError, match=r"found places=10, expected none beside spacing=0.1"):
        workspace(l1, LIMITS, spacing=0.1, places=10)
    with pytest.raises(ModelError, match=r"expected 2e.07 at most; take a wider spacing, fewer places or"):
        workspace(l1, LIMITS, places=10**9)
