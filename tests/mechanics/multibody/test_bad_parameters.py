"""Parameters, states and start values that no mechanism can have: refused with place, finding and remedy."""

import numpy as np
import pytest

from gantrytau import Fixed, GantryTauError, Model, ModelError, Start, StructureError, connect, der, translate
from gantrytau.mechanics import rotational, translational
from gantrytau.mechanics.multibody import LineForce, PointMass, SphericalSpherical, World
from tests.mechanics.multibody.test_bad_mechanisms import Driven, Swing, Thrown, refusal
from tests.mechanisms.rows import in_a_row, row
from tests.references.rotations import turn

# parameters


def test_a_rod_of_negative_length():
    Rod = in_a_row("Rod", world=World(), rod=SphericalSpherical(L=-1.0), mass=PointMass())

    assert "rod.L: value is -1, expected at least 0 (length between" in refusal(Rod(), ModelError)
    assert "rod (SphericalSpherical): found rod.L = 0; expected" in refusal(Rod(rod=dict(L=0.0)), ModelError)


@pytest.mark.parametrize("model", [Swing, Thrown])
def test_negative_mass(model):
    assert "body.m: value is -1, expected at least 0 (mass)" in refusal(model(body=dict(m=-1.0)), ModelError)


def test_a_hinged_body_may_have_inertia_alone():
    at = translate(Swing(body=dict(m=0.0))).evaluate({"hinge.phi": 0.3})
    assert at["der(hinge.w)"] == pytest.approx(0.0, abs=1e-14)


@pytest.mark.parametrize("body", [dict(m=0.0), dict(J=np.zeros((3, 3)))])
def test_a_free_body_without_inertia(body):
    found = refusal(Thrown(body=body), StructureError)
    assert "the body has no mass or inertia against this motion" in found
    assert "Expected mass" in found


def test_a_hinged_body_without_mass_and_inertia():
    found = refusal(Swing(body=dict(m=0.0, J=np.zeros((3, 3)))), StructureError)
    assert "nothing holds the rotation about its axis" in found
    assert "hinge" in found


IMPOSSIBLE = {
    "expected a symmetric, positive definite": np.diag([-0.1, 0.1, 0.1]),
    "none exceeds the sum of the other two": np.diag([1.0, 0.1, 0.1]),
    "expected a symmetric": np.array([[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
}


@pytest.mark.parametrize("words", IMPOSSIBLE)
def test_an_inertia_that_no_body_has(words):
    found = refusal(Thrown(body=dict(J=IMPOSSIBLE[words])), ModelError)
    assert "body (Body): found body.J[0,0] =" in found
    assert words in found


@pytest.mark.parametrize("J", [np.zeros((3, 3)), np.diag([0.0, 0.1, 0.1]), np.diag([0.2, 0.1, 0.1])])
def test_inertias_of_points_rods_and_discs_are_welcome(J):
    turned = turn(np.array([0.3, -0.8, 0.5]))
    assert translate(Swing(body=dict(J=turned @ J @ turned.T))).diagnosis.mobility == 1


def test_a_thin_plate_with_rounded_inertia_is_welcome():
    # J_z = J_x + J_y of a plate, which rounding to the digits printed may exceed by one digit
    assert translate(Swing(body=dict(J=np.diag([0.1234, 0.2345, 0.3580])))).diagnosis.mobility == 1


def test_an_inertia_of_the_wrong_shape():
    assert "body.J: value has shape (2, 2), expected" in refusal(Thrown(body=dict(J=np.eye(2))), ModelError)


def test_an_axis_of_length_zero():
    found = refusal(Swing(hinge=dict(n=[0.0, 0.0, 0.0])), ModelError)
    assert "hinge (Revolute): found hinge.n[0] = 0" in found
    assert "expected an axis that is not zero" in found


def test_a_line_force_between_points_that_coincide():
    class Line(Model):
        world, line, spring = World(), LineForce(), translational.Spring()
        mass = PointMass(frame_a=dict(r=Fixed([0.0, 0.0, 0.0])))

        def equations(self):
            yield from row(self.world, self.line, self.mass)
            yield connect(self.line.flange_a, self.spring.flange_a)
            yield connect(self.line.flange_b, self.spring.flange_b)

    assert "line" in refusal(Line(), GantryTauError)


# states, causality, start values


@pytest.mark.parametrize(
    ("states", "kind", "words"),
    [
        (["hinge.tau"], StructureError, "hinge.tau is constant and cannot be a state"),
        (["hinge.phii"], ModelError, "has no variable or parameter 'hinge.phii'; did you mean 'hinge.phi'"),
        (["hinge.phi", "body.w[1]", "hinge.w"], StructureError, "cannot be a state"),
        (["body.q[1]"], GantryTauError, "body.q"),
        (["body.frame_a.R[0,1]"], StructureError, "body.frame_a.R[0,1] is no variable and cannot be a state"),
    ],
)
def test_states_that_cannot_be(states, kind, words):
    with pytest.raises(kind) as raised:
        translate(Swing(), states=states)
    assert words in str(raised.value)


def test_what_follows_from_variables_cannot_be_given():
    with pytest.raises(ModelError, match=r"given: body\.frame_a\.R\[0,1\] .*follows from"):
        translate(Swing(), given=["body.frame_a.R[0,1]"])


def test_a_causality_that_leaves_a_motion_open_says_what_is_missing():
    with pytest.raises(StructureError, match=r"does not determine source\.tau\. Give also"):
        translate(Driven()).function(["hinge.phi", "hinge.w"], ["source.tau"])


def test_a_model_without_inputs_asks_for_its_state():
    class Damped(Swing):
        damper = rotational.Damper(d=0.2)

        def equations(self):
            yield from super().equations()
            yield connect(self.damper.flange_a, self.hinge.support)
            yield connect(self.damper.flange_b, self.hinge.axis)

    with pytest.raises(StructureError, match=r"hinge\.phi does not determine der\(hinge\.w\)\. Give also"):
        translate(Damped()).function(["hinge.phi"], ["der(hinge.w)"])


def test_values_for_coordinates_that_do_not_exist():
    with pytest.raises(ModelError, match=r"body\.q\[0\] does not exist: the orientation follows from the"):
        translate(Swing()).evaluate({"body.q[0]": 1.0})


def test_equations_with_coordinates_that_do_not_exist():
    class Asked(Swing):
        def equations(self):
            yield from super().equations()
            yield der(self.body.q[0]) == 0

    found = refusal(Asked(), ModelError)
    assert "body.q[0], which does not exist" in found
    assert "use the orientation R" in found


@pytest.mark.parametrize("start", [Start([1.0, 0.0, 0.0, 0.0]), Fixed([0.0, 1.0, 0.0, 0.0])])
def test_start_values_of_coordinates_that_do_not_exist(start):
    found = refusal(Swing(body=dict(q=start)), ModelError)
    assert "body.q: found a start value, but it does not exist" in found
    assert "of those joints" in found
