"""Bodies from a CSV file: units, axes and points that programs for design choose, and what no body can have."""

from typing import Any

import numpy as np
import pytest

from gantrytau import Array, Model, ModelError, simulate, translate
from gantrytau.mechanics.multibody import Body, Fixed, Inertias, Revolute, World, read_inertias
from tests.mechanisms.rows import row

ELEMENTS = ("xx", "yy", "zz", "xy", "xz", "yz")
HEADER = "name, m [kg], x [mm], y [mm], z [mm], " + ", ".join(f"J{each} [kg.mm2]" for each in ELEMENTS)
SIZE = np.array([0.2, 0.1, 0.05])  # m, of a cuboid of 3 kg
MASS = 3.0
TURNED = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])  # a rotation
J = TURNED @ np.diag(MASS / 12 * (SIZE @ SIZE - SIZE**2)) @ TURNED.T  # kg.m2
CENTRE = np.array([0.3, -0.1, 0.02])  # m


class Arm(Model):
    """A bar about a hinge."""

    world = World()
    base = Fixed()
    hinge = Revolute(n=[0.0, 1.0, 0.0])
    bar = Body()

    def equations(self):
        yield from row(self.base, self.hinge, self.bar)


class Pair(Model):
    """Two arms."""

    arms = Array(Arm, 2)


@pytest.fixture
def written(tmp_path):
    """Writes lines to a file and returns its path."""

    def write(*lines: str):
        file = tmp_path / "inertias.csv"
        file.write_text("\n".join(lines), encoding="utf-8")
        return file

    return write


def line(name: str, m: float, r: np.ndarray, inertia: np.ndarray, mark: str = ",") -> str:
    """A line of the table, in kg, mm and kg.mm2."""
    elements = [*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]]
    numbers = [m, *(1e3 * np.asarray(r)), *(1e6 * np.array(elements))]
    cells = [f"{x:.12g}" for x in numbers]
    return mark.join([name, *(cell.replace(".", ",") if mark != "," else cell for cell in cells)])


def test_bodies_come_back_in_si(written):
    found = read_inertias(
        written(HEADER, line("bar", MASS, CENTRE, J), line("plate", 1.0, 0 * CENTRE, 2 * J))
    )
    assert isinstance(found, Inertias)
    assert list(found) == ["bar", "plate"]
    assert found["bar"]["m"] == MASS
    np.testing.assert_allclose(found["bar"]["r_cm"], CENTRE, atol=1e-12)
    np.testing.assert_allclose(found["bar"]["J"], J, atol=1e-12)
    np.testing.assert_allclose(found["plate"]["J"], 2 * J, atol=1e-12)
    assert set(found.parameters) == {f"{n}.{key}" for n in ("bar", "plate") for key in ("m", "r_cm", "J")}


def test_semicolons_decimal_commas_marks_and_other_columns(written):
    header = "\ufeff" + HEADER.replace(",", ";") + ";material"
    found = read_inertias(written(header, "", line("bar", MASS, CENTRE, J, ";") + ";Stahl, blank"))
    np.testing.assert_allclose(found["bar"]["J"], J, atol=1e-12)


def test_without_units_numbers_are_si_and_what_is_missing_is_zero(written):
    found = read_inertias(written("Body,mass,Ixx,Iyy,Izz", "rod,2,0,0.5,0.5"))
    assert found["rod"] == {"m": 2.0, "r_cm": [0.0, 0.0, 0.0], "J": pytest.approx(np.diag([0.0, 0.5, 0.5]))}


def test_inertias_about_the_frame_and_integrals_are_brought_to_the_tensor_about_the_centre(written):
    about = J + MASS * (CENTRE @ CENTRE * np.eye(3) - np.outer(CENTRE, CENTRE))  # parallel axes
    products = 2 * np.diag(np.diag(about)) - about  # integrals of x y dm are the negatives
    found = read_inertias(
        written(HEADER, line("bar", MASS, CENTRE, products)), about="frame", products="integrals"
    )
    np.testing.assert_allclose(found["bar"]["J"], J, atol=1e-12)


def test_a_model_with_the_file_is_the_one_with_the_numbers(written):
    found = read_inertias(written(HEADER, line("bar", MASS, CENTRE, J)))
    by_hand = simulate(Arm(bar=dict(m=MASS, r_cm=CENTRE, J=J)), stop=0.5)
    for read in (
        simulate(Arm(**found), stop=0.5),
        simulate(found.given_to(Arm()), stop=0.5),
        simulate(Arm(), stop=0.5, parameters=found.parameters),
    ):
        np.testing.assert_allclose(read["hinge.phi"], by_hand["hinge.phi"], atol=1e-9)
    # a physical pendulum begins to fall by m g x / (Jyy + m (x2 + z2)) where its centre lies beside the hinge
    arm = MASS * (CENTRE[0] ** 2 + CENTRE[2] ** 2) + J[1, 1]
    assert translate(Arm(**found)).evaluate()["der(hinge.w)"] == pytest.approx(MASS * 9.81 * CENTRE[0] / arm)


def test_bodies_deep_in_a_model_have_dotted_names(written):
    found = read_inertias(
        written(HEADER, line("arms[0].bar", MASS, CENTRE, J), line("arms[1].bar", 1.0, CENTRE, J))
    )
    values = translate(found.given_to(Pair())).parameter_values
    assert (values["arms[0].bar.m"], values["arms[1].bar.m"]) == (MASS, 1.0)
    np.testing.assert_allclose(values["arms[0].bar.J[0,1]"], J[0, 1], atol=1e-12)


def test_names_that_no_model_has_are_refused(written):
    file = written(HEADER, line("arms[0].bat", MASS, CENTRE, J))
    with pytest.raises(ModelError, match=r"inertias\.csv: .*arms\[0\].*has no 'bat'; did you mean 'bar'"):
        read_inertias(file).given_to(Pair())
    file = written(HEADER, line("arms[0].hinge", MASS, CENTRE, J))
    with pytest.raises(ModelError, match=r"hinge.*has no 'm'"):
        read_inertias(file).given_to(Pair())
    with pytest.raises(ModelError, match=r"there is no body 'hinge'; did you mean 'arms\[0\]\.hinge'"):
        read_inertias(file)["hinge"]


def moments(*three: float) -> np.ndarray:
    """An inertia along the axes."""
    return np.diag(three)


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ([], "found 0 lines, expected a header"),
        ([HEADER], "found 1 lines, expected a header"),
        ([HEADER, "bar,3"], "line 2 has 2 cells, expected 11"),
        ([HEADER, line("bar", MASS, CENTRE, J), line("bar", MASS, CENTRE, J)], "line 3: found 'bar' a second time"),
        ([HEADER, line(" ", MASS, CENTRE, J)], "line 2: found no name"),
        ([HEADER, line("bar", 0.0, CENTRE, J)], "bar: found a mass of 0 kg, expected one above zero"),
        ([HEADER, line("bar", -1.0, CENTRE, J)], "bar: found a mass of -1 kg"),
        ([HEADER, line("bar", np.nan, CENTRE, J)], "line 2, column m: found 'nan', expected a number"),
        ([HEADER, line("bar", np.inf, CENTRE, J)], "line 2, column m: found 'inf', expected a number"),
        ([HEADER, line("bar", MASS, CENTRE, J).replace("3,", ",", 1)], "column m: found an empty cell"),
        ([HEADER, line("bar", MASS, CENTRE, J).replace("bar,3", "bar,three")], "found 'three', expected a number"),
        ([HEADER, line("bar", 1.0, CENTRE, moments(1, 1, -1))], "inertia -1, 1, 1 kg.m2, expected none below"),
        ([HEADER, line("bar", 1.0, CENTRE, moments(1, 1, 3))], "expected none above the sum of the other two"),
        ([HEADER, line("bar", 1.0, CENTRE, 1e6 * J)], "found a radius of gyration of"),
        ([HEADER.replace("m [kg]", "m [mm]"), line("bar", MASS, CENTRE, J)], "found 'mm', a length, expected a mass in kg"),
        ([HEADER.replace("m [kg]", "m [kgs]"), line("bar", MASS, CENTRE, J)], "there is no unit 'kgs'"),
        ([HEADER.replace("m [kg]", "weight"), line("bar", MASS, CENTRE, J)], "found no column m, expected name, m [kg]"),
        ([HEADER.replace("z [mm]", "z"), line("bar", MASS, CENTRE, J)], "found x in mm and z without a unit, expected"),
        ([HEADER.replace("Jxz [kg.mm2]", "Jxz"), line("bar", MASS, CENTRE, J)], "write 'Jxz [kg.mm2]'"),
        ([HEADER.replace("y [mm]", "why"), line("bar", MASS, CENTRE, J)], "no column y, expected x, y, z, all or none"),
        ([HEADER.replace("Jxz", "Jyx"), line("bar", MASS, CENTRE, J)], "found the columns Jyx and Jxy, expected one"),
    ],
)  # fmt: skip
def test_what_is_no_body_is_refused_in_words(written, lines, words):
    file = written(*lines)
    with pytest.raises(ModelError) as error:
        read_inertias(file)
    assert words.replace("Jyx and Jxy", "Jxy and Jyx") in str(error.value) or words in str(error.value)
    assert "inertias.csv" in str(error.value)


def test_an_inertia_that_is_about_the_centre_already_is_told(written):
    file = written(HEADER, line("bar", MASS, CENTRE, J))
    with pytest.raises(ModelError, match="were they about it already, about='centre'"):
        read_inertias(file, about="frame")


def test_files_and_choices_that_do_not_exist_are_refused(tmp_path, written):
    with pytest.raises(ModelError, match="found no file to read"):
        read_inertias(tmp_path / "none.csv")
    file = written(HEADER, line("bar", MASS, CENTRE, J))
    wrongly: Any = read_inertias
    for name in ("about", "products"):
        with pytest.raises(ModelError, match=f"found {name}='mid', expected '") as error:
            wrongly(file, **{name: "mid"})
        assert error.value.argument == name


def test_it_prints_itself_in_short(written):
    found = read_inertias(written(HEADER, *(line(f"b{k}", MASS, CENTRE, J) for k in range(99))))
    assert len(repr(found)) < 400
    assert "of 99" in repr(found)
