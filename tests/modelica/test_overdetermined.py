"""Mechanisms in a plane whose directions are records that are passed on along the spanning tree of `Connections.*`."""

import numpy as np
import pytest

from gantrytau import ModelError, load_modelica, simulate, translate

TEXT = """package Plane
  record Direction
    Real e[2] "the x axis of the frame, in the world";
    function equalityConstraint
      input Direction a;
      input Direction b;
      output Real residue[1];
    algorithm
      residue[1] := a.e[1] * b.e[2] - a.e[2] * b.e[1];
    end equalityConstraint;
  end Direction;
  connector Frame
    Real x[2];
    Direction R;
    flow Real f[2];
    flow Real t[1];
  end Frame;
  function turned
    input Direction R;
    input Real phi;
    output Direction found;
  algorithm
    found.e := {R.e[1] * cos(phi) - R.e[2] * sin(phi), R.e[1] * sin(phi) + R.e[2] * cos(phi)};
  end turned;
  model World
    parameter Real g = 9.81;
    parameter Real down[2] = {0, -1};
    function weight
      input Real m;
      input Real direction[2];
      output Real f[2];
    algorithm
      f := m * direction;
    end weight;
    replaceable function pull = weight(direction = g * down);
    Frame b;
  equation
    Connections.root(b.R);
    b.x = {0, 0};
    b.R = Direction({1, 0});
  end World;
  model Hinge
    Frame a, b;
    Real phi(start = 0), w, tau = 0;
  equation
    Connections.branch(a.R, b.R);
    w = der(phi);
    a.x = b.x;
    a.f + b.f = {0, 0};
    a.t + b.t = {0};
    b.t[1] = -tau;
    if Connections.rooted(a.R) then
      b.R = turned(a.R, phi);
    else
      a.R = turned(b.R, -phi);
    end if;
  end Hinge;
  model Rod
    parameter Real L = 1;
    Frame a, b;
  equation
    Connections.branch(a.R, b.R);
    a.R = b.R;
    b.x = a.x + L * a.R.e;
    a.f + b.f = {0, 0};
    a.t[1] + b.t[1] + L * (a.R.e[1] * b.f[2] - a.R.e[2] * b.f[1]) = 0;
  end Rod;
  model Point
    outer World world;
    parameter Real m = 2;
    Frame a;
    Real v[2];
    Boolean free = here;
  protected
    parameter Boolean here(fixed = false);
  initial equation
    if Connections.isRoot(a.R) then
      here = true;
    else
      here = false;
    end if;
  equation
    Connections.potentialRoot(a.R, 10);
    if Connections.isRoot(a.R) then
      a.R = Direction({1, 0});
    else
      a.t = {0};
    end if;
    v = der(a.x);
    m * der(v) = a.f + world.pull(m);
  end Point;
  model Pendulum
    inner World world;
    Hinge hinge(phi(fixed = true), w(fixed = true, start = 0));
    Rod rod(L = 0.7);
    Point end_point, falling(a.x(each fixed = true), v(each fixed = true));
  equation
    connect(world.b, hinge.a);
    connect(hinge.b, rod.a);
    connect(rod.b, end_point.a);
  end Pendulum;
  model Parallelogram
    inner World world(down = {1, 0});
    Hinge A(phi(fixed = true, start = 0.3), w(fixed = true, start = 0.2)),
          B(phi(start = -0.3)), C(phi(start = 0.3)), D(phi(start = 0.3));
    Rod ground(L = 2), crank, coupler(L = 2), rocker;
    Point p;
  equation
    connect(world.b, ground.a);
    connect(world.b, A.a);
    connect(A.b, crank.a);
    connect(crank.b, B.a);
    connect(B.b, coupler.a);
    connect(coupler.b, p.a);
    connect(ground.b, D.a);
    connect(D.b, rocker.a);
    connect(rocker.b, C.b);
    connect(C.a, coupler.b);
  end Parallelogram;
  model Silent
    World world;
    Frame a;
  equation
    Connections.branch(world.b.R, a.R);
    a.x = world.b.x;
    a.R.e[1] = 1;
  end Silent;
end Plane;
"""


@pytest.fixture(scope="module")
def plane(tmp_path_factory):
    path = tmp_path_factory.mktemp("plane") / "plane.mo"
    path.write_text(TEXT)
    return load_modelica(path)


def test_a_pendulum_keeps_its_energy_and_a_body_without_a_joint_is_a_root(plane):
    swing = simulate(plane["Plane.Pendulum"](), stop=1.0, tolerance=1e-9)
    w, phi = swing["hinge.w"], swing["hinge.phi"]
    assert np.abs(0.7 * w**2 / 2 + 9.81 * np.sin(phi)).max() < 1e-6  # a thousand times the tolerance
    assert swing.final("falling.a.x[2]") == pytest.approx(-9.81 / 2)
    assert (swing.final("end_point.here"), swing.final("falling.here")) == (0, 1)


def test_a_connection_that_closes_a_loop_lets_the_function_of_its_record_vanish(plane):
    swing = simulate(plane["Plane.Parallelogram"](), stop=0.4, tolerance=1e-9)
    w, phi = swing["A.w"], swing["A.phi"]
    assert np.ptp(w**2 / 2 - 9.81 * np.cos(phi)) < 1e-6
    for name, sign in dict(B=-1, C=1, D=1).items():
        assert swing[f"{name}.phi"] == pytest.approx(sign * phi, abs=1e-6)


def test_a_branch_of_which_no_equation_speaks_is_named(plane):
    with pytest.raises(
        ModelError, match=r"^a: found no equation that says what R\.e is from world\.b, expected"
    ):
        translate(plane["Plane.Silent"])


def test_what_the_connections_determine_stands_in_conditions_of_equations_only(tmp_path):
    path = tmp_path / "asked.mo"
    path.write_text(TEXT.replace("L = 1;", "L = if Connections.isRoot(a.R) then 1 else 2;"))
    with pytest.raises(
        ModelError, match=r"line \d+, column \d+: found Connections\.isRoot\(\), .* 'if' among equations"
    ):
        translate(load_modelica(path)["Plane.Parallelogram"]())
