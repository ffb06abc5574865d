"""The gallery: its examples run and show something, and solids are drawn as large as they are."""

import io

import numpy as np
import pytest
from PIL import Image

from gantrytau import Model
from gantrytau.results.result import Result
from gantrytau.viewing import Ball, Stick
from gantrytau.viewing.film import film_of
from gantrytau.viewing.page import VIEW
from notebooks.site.builder.gallery.drawn_examples import Drawn, run
from notebooks.site.builder.gallery.examples import examples
from notebooks.site.builder.gallery.scene_picture import scene_picture
from notebooks.site.builder.generated.gallery_page import gallery_page
from notebooks.site.builder.reading.public_names import public_names

OTHERS = {  # what a model, a problem or a fit is made of
    "gantrytau.Model",
    "gantrytau_optimica.IdentifiedSystem",
    "gantrytau_optimica.Optimization",
    "gantrytau_optimica.Way",
}


@pytest.mark.parametrize("name", examples())
def test_an_example_runs_and_shows_something(name):
    picture, scene, equations = run(examples()[name])
    alpha = np.asarray(Image.open(io.BytesIO(picture)).convert("RGBA"))[..., 3]
    assert 0.001 < (alpha > 0).mean() < (1.0 if scene else 1.01)
    assert equations
    assert len(examples()[name].alt) > len(examples()[name].name) + 10


def test_every_component_has_an_example_unless_it_is_a_base():
    models = [one for one in public_names() if isinstance(one.value, type) and issubclass(one.value, Model)]
    concrete = {
        one.full for one in models if not one.same_as and not (one.value.__doc__ or "").startswith("Base of")
    }
    assert concrete - set(examples()) == OTHERS
    assert set(examples()) <= concrete | {"gantrytau.mechanics.robot_files.DescribedRobot"}


def coloured(*shapes):
    """A picture of shapes in numbers, RGBA, 0 to 1."""
    film = film_of(Result([0.0], {}, shapes=shapes))
    return np.asarray(Image.open(io.BytesIO(scene_picture(film))).convert("RGBA")) / 255.0


def drawn(*shapes):
    """What is opaque in it."""
    return coloured(*shapes)[..., 3]


def test_a_ball_is_a_disc_and_a_bar_as_long_as_it_is_seen():
    ball = drawn(Ball(at=(10.0, 0.0, 0.0), radius=1.0), Ball(at=(10.0, 0.0, 0.01), radius=1.0))
    assert ball.mean() == pytest.approx(np.pi / 4, rel=0.02)  # of the square around it
    bar = drawn(Stick(a=(10.0, 0.0, 0.0), b=(10.0, 0.0, 5.0), radius=0.5))
    upwards = VIEW[2] / np.linalg.norm(VIEW)
    # its length and the ends that are seen from above, over its width
    ratio = 5.0 * np.sqrt(1 - upwards**2) + upwards
    assert np.divide(*bar.shape) == pytest.approx(ratio, rel=0.02)


def test_what_stands_in_front_hides_what_is_behind():
    towards = VIEW / np.linalg.norm(VIEW)
    here = np.array([10.0, 0.0, 0.0])
    ends = [Ball(at=np.add(here, [0.0, 0.0, z]), radius=0.1) for z in (-3.0, 3.0)]  # of pictures of one size
    front, behind = Ball(at=here + towards, radius=0.8), Ball(at=here - towards, radius=0.8, mass=1.0)
    assert np.array_equal(coloured(front, behind, *ends), coloured(front, *ends))
    assert not np.array_equal(coloured(behind, *ends), coloured(front, *ends))


def test_pictures_of_the_gallery_lead_to_components_and_one_that_is_seen_twice_names_both(tmp_path):
    names = [name for name in examples() if name.startswith("gantrytau.blocks.")]
    for name in names:
        (tmp_path / name).write_text("one" if name.endswith("Pid") else name)
    page = gallery_page({name: Drawn(examples()[name], tmp_path / name, False, "") for name in names})
    assert page.count("{figure}") == len(names) - 1
    assert ":target: ../reference/blocks.html#gantrytau.blocks.Gain\n" in page
    assert "{py:obj}`Pid <gantrytau.blocks.Pid>` {py:obj}`DiscretePid <gantrytau.blocks.DiscretePid>`" in page
    assert f":alt: {examples()['gantrytau.blocks.Gain'].alt}\n" in page
