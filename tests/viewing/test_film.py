"""Solids at the instants of the pictures, against the results that they are of."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gantrytau import ModelError, Result, animate, simulate, translate, view
from gantrytau.kinematics import Box, Capsule, Cylinder
from gantrytau.language.self_description.appearance import Ball, Cuboid, Hinge, Lump, Stick
from gantrytau.viewing.film import MOST, film_of
from gantrytau.viewing.solids import along, extent, solids
from gantrytau_models import GantryTau, Pendulum, SixLinkGantryTau, prototypes

NOTHING: Any = None
AT_X = ("x", 0.0, 0.0)
ROUND = 1e-9  # m, of places that are computed from others of some metres, and of unit vectors


@pytest.fixture(scope="module")
def fall():
    return simulate(SixLinkGantryTau(prototypes.D1), stop=0.1, points=7, inputs={"carts[0].f": 200.0})


@pytest.fixture(scope="module")
def film(fall):
    return film_of(fall)


def of(film, owner, kind):
    return next(s for s in solids(film) if s.owner == owner and s.kind == kind)


def test_rods_end_in_their_frames(fall, film):
    at = [np.flatnonzero(np.isclose(film.times, t, rtol=0, atol=1e-12)) for t in fall.time]
    shown = [(k, row[0]) for k, row in enumerate(at) if row.size]
    assert len(shown) == 7  # a tenth of a second has pictures at all of its sixtieths
    for rod in ("arms[0].links[0].rod", "arms[2].links[1].rod"):
        bar = of(film, rod, "cylinder")
        half = bar.R[:, :, 2] * bar.size[:, 2:] / 2
        for end, name in ((bar.r - half, "frame_a.r"), (bar.r + half, "frame_b.r")):
            for k, row in shown:
                assert np.allclose(end[row], fall[f"{rod}.{name}"][k], rtol=0, atol=ROUND)
        length = fall["arms[0].links[0].length"][0] if "[0].rod" in rod else bar.size[0, 2]
        # tolerance of the constraints
        assert np.allclose(bar.size[[row for _, row in shown], 2], length, rtol=0, atol=1e-6)


def test_the_plate_turns_with_its_frame(fall, film):
    plate = of(film, "tool", "axes")
    for k, t in enumerate(fall.time):
        row = int(np.argmin(abs(film.times - t)))
        assert np.allclose(plate.R[row], fall["tool.R"][k], rtol=0, atol=ROUND)
        assert np.allclose(plate.r[row], fall["tool.r"][k], rtol=0, atol=ROUND)


def test_between_instants_of_a_result_a_body_turns_about_one_axis():
    turns = Rotation.from_rotvec([[0.0, 0.0, 0.0], [0.0, 0.0, 1.2]]).as_matrix()
    rows = {f"R[{i},{j}]": turns[:, i, j] for i in range(3) for j in range(3)}
    result = Result([0.0, 1.0], rows, shapes=[Cuboid(at=(0.0, 0.0, 0.0), size=(1.0, 2.0, 3.0), R="R")])
    film = film_of(result)
    turned = Rotation.from_matrix(film.rotations("R")).as_rotvec()
    assert np.allclose(turned, np.outer(film.times, [0.0, 0.0, 1.2]), rtol=0, atol=ROUND)


def test_a_lump_has_the_inertia_of_its_body():
    J = np.diag([0.3, 0.2, 0.25])
    constants = {f"J[{i},{j}]": J[i, j] for i in range(3) for j in range(3)}
    constants |= {f"R[{i},{j}]": float(i == j) for i in range(3) for j in range(3)}
    constants |= {f"c[{i}]": 0.1 * i for i in range(3)} | {"m": 8.0}
    lump = Lump(at=(1.0, 0.0, 0.0), R="R", mass="m", r_cm="c", J="J")
    (solid,) = solids(film_of(Result([0.0], constants, shapes=[lump])))
    edges, R = solid.size[0], solid.R[0]
    moments = 8.0 / 12 * (np.sum(edges**2) - edges**2)  # of a cuboid
    assert np.allclose(R @ np.diag(moments) @ R.T, J, rtol=1e-12)
    assert np.allclose(solid.r, [1.0, 0.1, 0.2], rtol=0, atol=ROUND)


@pytest.mark.parametrize("way", [[0, 0, 1], [0, 0, -1], [1, 0, 0], [0, -2, 0], [1e-9, 0, 0], [1e9, 1e9, 0]])
def test_bars_lie_along_any_direction(way):
    (R,) = along(np.array([way], dtype=float))
    assert np.allclose(R.T @ R, np.eye(3), rtol=0, atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)
    assert np.allclose(R[:, 2], np.array(way) / np.linalg.norm(way), rtol=0, atol=1e-12)


def test_pictures_follow_one_another_60_times_a_second_of_the_page():
    result = Result([0.0, 2.0], {"x": [0.0, 1.0]}, shapes=[Ball(at=("x", 0.0, 0.0))])
    assert len(film_of(result).times) == 121
    assert len(film_of(result, speed=0.5).times) == 241
    assert film_of(result, speed=0.5).step == pytest.approx(1 / 60)
    slow = film_of(result, speed=1e-3)
    assert (len(slow.times), slow.step) == (MOST + 1, pytest.approx(2000 / MOST))
    assert len(film_of(result, speed=1e9).times) == 2


def test_obstacles_stand_where_they_are(fall):
    turned = Rotation.from_rotvec([0, 0, np.pi / 2]).as_matrix()
    box = Box([0.0, 0.0, 0.0], [2.0, 4.0, 6.0], R=turned)
    around = [box, Cylinder([0, 0, 0], [0, 0, 1], 0.1), Capsule([0, 0, 0], [0, 0, 9], 0.2)]
    film = film_of(fall, around=around)
    found = [s for s in solids(film) if s.role == "around"]
    assert [s.kind for s in found] == ["cuboid", "cylinder", "cylinder", "ball", "ball"]
    assert found[0].r[0] == pytest.approx([1.0, 2.0, 3.0])
    assert found[1].size[0] == pytest.approx([0.2, 0.2, 1.0])
    low, high = extent(film)
    assert low[0] <= 1.0 - 2.0  # the long side lies along x
    assert high[2] >= 9.0


def refused(call):
    with pytest.raises(ModelError) as error:
        call()
    return str(error.value)


def test_what_cannot_be_shown_is_told(fall):
    assert "animate: found float, expected what simulate or optimize" in refused(lambda: animate(3.0))
    assert "found an empty list" in refused(lambda: animate([]))
    for names in (["a"], "ab"):
        message = refused(lambda names=names: animate([fall, fall], names=names))
        assert f"found names={names!r}, expected a list of texts, one for each of 2 results" in message
    assert "around: found float, expected obstacles" in refused(lambda: animate(fall, around=[1.0]))
    assert "view: found Result, expected a model" in refused(lambda: view(fall))
    pose: Any = "tool.r"
    assert "view: found pose='tool.r', expected values by name" in refused(lambda: view(Pendulum, pose))


def test_a_model_without_anything_to_be_seen_is_told():
    message = refused(lambda: view(Pendulum(drawn=False)))
    assert "Pendulum: found nothing that could be shown, expected components of" in message
    assert "shapes()" in message


def test_a_result_of_few_variables_says_what_is_left_out():
    some = simulate(GantryTau(prototypes.L1), stop=0.01, points=3, outputs=["tool.v"])
    message = refused(lambda: animate(some))
    assert "expected all that its shapes hang on; simulate the same model with all outputs" in message


def test_values_that_are_not_finite_are_told():
    result = Result(
        [0.0, 1.0, 2.0], {"x": [0.0, np.nan, 1.0]}, title="Odd", shapes=[Ball(at=("x", 0.0, 0.0))]
    )
    assert "Odd: found x = nan at 1 s, expected finite numbers" in refused(lambda: animate(result))


@pytest.mark.parametrize(
    ("shape", "words"),
    [
        (Stick(a=(0.0, 0.0, 0.0), b=(0.0, 0.0)), "found (0.0, 0.0) of shape (2,) in shapes()"),
        (Ball(at="x"), "found 'x' of shape () in shapes(), expected one of shape (3,); a place is the name"),
        (Ball(at=(np.nan, 0.0, 0.0)), "found shapes() = nan, expected finite numbers"),
        (Stick(a=(0.0, 0.0, 0.0), b=NOTHING), "found shapes()=None, expected numbers"),
        (Ball(at=AT_X, radius=-1.0), "the model: found the radius or mass -1 of a Ball"),
        (Hinge(at=AT_X, axis=(0.0, 0.0, 0.0)), "found the direction [0, 0, 0] of a Hinge"),
        (Cuboid(at=AT_X, size=(1.0, 1.0, 1.0), R="x"), "of shape () in shapes(), expected one of shape (3"),
    ],
)
def test_shapes_that_cannot_be_are_told(shape, words):
    assert words in refused(lambda: animate(Result([0.0, 1.0], {"x": [0.0, 1.0]}, shapes=[shape])))


def test_results_of_one_point_and_of_one_instant_are_pictures():
    dae = translate(Pendulum())
    single = simulate(dae, stop=1.0, points=2).select(["x", "y", "m"])
    assert len(film_of(single).times) == 61
    still = Result([3.0], {"x": 0.1}, shapes=[Stick(a=(0.0, 0.0, 0.0), b=("x", 0.0, 0.0))])
    film = film_of(still)
    assert film.times.tolist() == [3.0]
    (bar,) = solids(film)
    assert bar.size[0, 2] == pytest.approx(0.1)
    twice = Result([0.0, 0.5, 0.5, 1.0], {"x": [0.0, 0.0, 1.0, 1.0]}, shapes=[Ball(at=("x", 0.0, 0.0))])
    (ball,) = solids(film_of(twice))  # both sides of a jump
    assert ball.r[[0, -1], 0].tolist() == [0.0, 1.0]
