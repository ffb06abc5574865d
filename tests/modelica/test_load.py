"""Modelica text as classes: the same trajectories as models in Python, and what is said of wrong text."""

from pathlib import Path

import numpy as np
import pytest

import gantrytau
from gantrytau import (
    Array,
    Discrete,
    Fixed,
    Model,
    ModelError,
    Parameter,
    Real,
    SolveError,
    check,
    connect,
    der,
    linearize,
    load_modelica,
    pre,
    reinit,
    simulate,
    terminate,
    when,
)
from gantrytau.electrical import Capacitor, DcMotor, Ground, Resistor, VoltageSource
from gantrytau.mechanics import translational

HERE = Path(__file__).parent
SAME = 1e-8  # ten times the tolerance of the runs, 1e-9, in units of values below 10


@pytest.fixture(scope="module")
def drive():
    return load_modelica(HERE / "drive.mo")


@pytest.fixture(scope="module")
def motions():
    return load_modelica(HERE / "motions.mo")


def same(a, b, names, stop):
    """Whether two models have one trajectory of variables that they call by two names."""
    one, other = (simulate(m, stop=stop, tolerance=1e-10, points=51) for m in (a, b))
    for name, wanted in names.items():
        at = [(r.at(t, n)) for r, n in ((one, name), (other, wanted)) for t in np.linspace(0, stop, 51)]
        np.testing.assert_allclose(
            at[:51], at[51:], rtol=0, atol=SAME * max(1.0, np.max(np.abs(at))), err_msg=name
        )


class Rc(Model):
    source, ground = VoltageSource(v=10.0), Ground()
    r, c = Resistor(R=100.0), Capacitor(C=1e-3, v=Fixed(2.0))

    def equations(self):
        yield connect(self.source.pin_a, self.r.pin_a)
        yield connect(self.r.pin_b, self.c.pin_a)
        yield connect(self.c.pin_b, self.source.pin_b)
        yield connect(self.source.pin_b, self.ground.pin)


class Driven(Model):
    source, ground = VoltageSource(v=24.0), Ground()
    motor = DcMotor(R=3.0, J=2e-4, rotor=dict(phi=Fixed(0.0), w=Fixed(0.0)), inductor=dict(i=Fixed(0.0)))

    def equations(self):
        yield connect(self.source.pin_a, self.motor.pin_a)
        yield connect(self.source.pin_b, self.motor.pin_b)
        yield connect(self.source.pin_b, self.ground.pin)


class Chain(Model):
    mass = Array(translational.Mass, [dict(m=k + 1.0, s=Fixed(0.1), v=Fixed(0.0)) for k in range(5)])
    spring = Array(translational.SpringDamper, 5, c=50.0, d=0.1)
    wall = translational.Fixed()

    def equations(self):
        yield connect(self.spring[0].flange_a, self.wall.flange)
        for k in range(5):
            yield connect(self.spring[k].flange_b, self.mass[k].flange)
        for k in range(1, 5):
            yield connect(self.mass[k - 1].flange, self.spring[k].flange_a)


class Swing(Model):
    phi = Real(unit="rad", start=np.arctan2(0.3, 0.4), fixed=True)
    w = Real(unit="rad/s", start=0.0, fixed=True)
    L = Parameter(0.5, unit="m")
    g = Parameter(9.81, unit="m/s2")
    x = Real(unit="m")

    def equations(self):
        yield self.w == der(self.phi)
        yield der(self.w) == -self.g / self.L * gantrytau.sin(self.phi)
        yield self.x == self.L * gantrytau.sin(self.phi)


class Ball(Model):
    h = Real(unit="m", start=1.0, fixed=True)
    v = Real(unit="m/s", start=0.0, fixed=True)
    n = Discrete(0)

    def equations(self):
        yield der(self.h) == self.v
        yield der(self.v) == -9.81
        yield when(self.h <= 0, reinit(self.v, -0.8 * pre(self.v)), self.n == pre(self.n) + 1)
        yield when(self.n >= 6, terminate("enough"))


def test_circuits_and_a_motor_of_a_package_move_as_those_in_python(drive):
    same(drive["Drive.Rc"](), Rc(), {"c.v": "c.v", "r.i": "r.i"}, 0.5)
    names = {"rotor.w": "motor.rotor.w", "resistor.i": "motor.i"}
    same(drive["Drive.WarmMotor"](), Driven(), names, 0.2)


def test_what_redeclares_a_component_keeps_its_constraint_alone(drive):
    choked = drive["Drive.Choked"]
    poles = np.array(linearize(choked()).poles, dtype=complex)
    assert np.sum(np.abs(np.imag(poles)) > 1.0) == 2  # it swings, as there is no resistance
    assert "resistor.R" not in gantrytau.flatten(choked()).scalars


def test_a_parameter_that_shapes_a_chain_makes_another_chain(drive):
    longer = drive["Drive.Chain"](n=5)
    same(longer, Chain(), {f"mass[{k + 1}].s": f"mass[{k}].s" for k in range(5)}, 2.0)
    assert len(check(drive["Drive.Chain"](walled=False)).states) == 7  # with the spring that nothing holds
    assert isinstance(longer, drive["Drive.Chain"])


def test_a_pendulum_and_a_ball_move_as_those_in_python(motions):
    same(motions["Motions.Pendulum"](), Swing(), {"r[1]": "x"}, 2.0)
    same(motions["Motions.Ball"](), Ball(), {"h": "h", "v": "v", "n": "n"}, 2.8)
    assert simulate(motions["Motions.Pendulum"](side="left"), stop=0.1)["r[1]"][0] == pytest.approx(-0.3)
    with pytest.raises(ModelError, match="found 'lefd' for 'side'; did you mean 'left'"):
        gantrytau.flatten(motions["Motions.Pendulum"](side="lefd"))
    result = simulate(motions["Motions.Ball"]())
    assert result.ended == "enough"
    assert simulate(motions["Motions.Pendulum"]()).time[-1] == 2.0  # of the experiment


def test_a_sampled_variable_changes_at_its_instants(motions):
    result = simulate(motions["Motions.Sampled"](), stop=0.38)
    x, u = 0.0, 0.0
    for k in range(4):
        u += 0.2 * (1 - x)
        assert result.at(0.1 * k + 0.05, "u") == pytest.approx(u, abs=1e-7)
        x = u + (x - u) * np.exp(-0.1)
    with pytest.raises(ModelError, match="it is locked"):
        simulate(motions["Motions.Sampled"](locked=True), stop=1)
    with pytest.raises(ModelError, match="expected a positive T"):
        simulate(motions["Motions.Sampled"](T=-1.0), stop=1)


def test_a_switch_with_hysteresis_swings_between_its_limits(motions):
    result = simulate(motions["Motions.Thermostat"](), stop=1.0)
    times = np.array([0.05, 0.2, 0.35, 0.45, 0.6])
    np.testing.assert_allclose(result.at(times, "T"), [0.55, 0.5, 0.45, 0.55, 0.5], atol=1e-9)
    np.testing.assert_array_equal(result.at(times, "on"), [1, 0, 1, 1, 0])


def test_an_assertion_that_fails_on_the_way_ends_the_run(motions):
    with pytest.raises(SolveError, match="x runs away"):
        simulate(motions["Motions.Sampled"](x=Fixed(4.9), u=gantrytau.Start(30.0)), stop=1)


def test_it_is_a_component_of_a_model_in_python(drive):
    class Rig(Model):
        motor = drive["Drive.Motor"](R=5.0)
        speed = Real(unit="rad/s")

        def equations(self):
            yield self.speed == self.motor.rotor.w

    result = simulate(Rig(motor=dict(source=dict(V=6.0))), stop=0.01)
    assert result["speed"][-1] == result["motor.rotor.w"][-1] > 0
    poles = linearize(drive["Drive.Motor"]()).poles
    assert np.sum(np.abs(poles) > 1e-6) == 2


COUNTED = """model M
  Boolean late = time > 0.5;
  Integer n(start=0, fixed=true);
  Real x;
  Real y[2] = {x, x};
equation
  x = time;
  when {late, edge(late), time > 0.4} then
    n = pre(n) + 1;
  elsewhen time > 0.1 then
    n = pre(n) + 10;
  end when;
  annotation(experiment(StartTime=0.05, StopTime=1));
end M;
"""


def test_each_condition_of_a_vector_acts_and_a_run_has_the_times_of_the_experiment(tmp_path):
    (tmp_path / "counted.mo").write_text(COUNTED)
    found = simulate(load_modelica(tmp_path / "counted.mo")["M"]())
    assert (found.time[0], found.time[-1], found.final("n")) == (0.05, 1.0, 12)
    assert found.final("y").tolist() == [1.0, 1.0]


WRONG = (  # text of a model, line and column, words
    ("model M\n  Real x = 2 * yy;\n  Real y = 1;\nend M;", "2:16", "found the name 'yy'.*did you mean 'y'"),
    ("model M\n  Rael x;\nend M;", "2:3", "found 'Rael', expected the name of a class; did you mean 'Real'"),
    (
        "model M\n  Real x(strat=1) = 1;\nend M;",
        "2:10",
        "found 'strat', which Real does not have; did you mean 'start'",
    ),
    (
        "model A\n  Real x = 1;\nend A;\nmodel M\n  A a(y=2);\nend M;",
        "5:7",
        "found 'y' modified, which A does not have",
    ),
    ("model A\n  final parameter Real x = 1;\nend A;\nmodel M\n  A a(x=2);\nend M;", "5:7", ".*'final'"),
    (
        "model M\n  Real x[3] = {1, 2, 3} + {1, 2};\nend M;",
        "2:15",
        "found the sizes \\[3\\] and \\[2\\] beside '\\+'",
    ),
    (
        "model M\n  Real x[3] = {1, 2, 3};\n  Real y = x[4];\nend M;",
        "3:12",
        "found the index 4, expected 1 to 3",
    ),
    ("model M\n  extends M;\nend M;", "1:7", "found M among the classes that it extends, expected no circle"),
    (
        "model M\n  Real x;\nequation\n  x = inStream(x);\nend M;",
        "4:7",
        "found inStream\\(\\), which is not supported",
    ),
    ("model M\n  Modelica.Electrical.R r;\nend M;", "2:3", "found 'Modelica.*libraries="),
    (
        "model M\n  Real x;\nequation\n  if time > 1 then\n    x = 1;\n  end if;\nend M;",
        "4:3",
        "found 1 and 0 equations",
    ),
    (
        "model M\n  Integer n(start=0);\nequation\n  when n > pre(n) then\n    n = pre(n) + 1;\n  end when;\nend M;",
        "4:3",
        "found n beside pre\\(n\\) in the condition of when",
    ),
    (
        "model M\n  parameter Integer n = n + 1;\n  Real x[n];\nend M;",
        "2:25",
        "found 'n', whose value needs itself",
    ),
)
FUNCTION = "function f\n  input Real u[2];\n  output Integer n = integer(u[1]);\nend f;\n"
MEANINGS = (  # where a wrong model would run: text, line and column, words
    (
        "model A\n  parameter Real p;\nend A;\nmodel M\n  A a[2](p={1, 2, 3});\nend M;",
        "5:10",
        "found 3 values for",
    ),
    ("model M\n  Real x[2](start=1);\nend M;", "2:13", "found a scalar, expected \\[2\\]; 'each'"),
    (
        FUNCTION + "model M\n  Real x = f({1, 2, 3});\nend M;",
        "2:14",
        "found \\[3\\] for 'u', expected \\[2\\]",
    ),
    ("model M\n  Boolean b = time;\nend M;", "2:15", "found Real for 'b', expected Boolean"),
    ("model M\n  parameter String s = 3.5;\nend M;", "2:24", "found 3.5 for 's', expected String"),
    ("model M\n  Boolean b = time > 1;\n  Real x = b + 1;\nend M;", "3:12", "found Boolean beside '\\+'"),
    (
        "model M\n  Integer n(start=0);\nequation\n  when time > 1 then\n    n = 2 * time;\n  end when;\nend M;",
        "5:9",
        "found Real .*, expected Integer; integer\\(\\)",
    ),
    (
        "type E = enumeration(a);\ntype F = enumeration(c);\nmodel M\n  parameter E e = E.a;\n"
        "  Boolean b = e == F.c;\nend M;",
        "5:20",
        "found F beside E",
    ),
    (
        "package A\n  constant Real k=1;\nend A;\npackage B\n  constant Real k=2;\nend B;\nmodel M\n  import A.*;\n"
        "  import B.*;\n  Real x = k;\nend M;",
        "9:10",
        "found 'k' imported as A.k and as B.k",
    ),
    (
        "model A\n  constant Real k=1;\nend A;\nmodel B\n  constant Real k=2;\nend B;\nmodel M\n  extends A;\n"
        "  extends B;\nend M;",
        "7:7",
        "found 'k' declared differently in A and in B",
    ),
    (
        "model A\nprotected\n  parameter Real p=1;\nend A;\nmodel M\n  A a(p=2);\nend M;",
        "6:7",
        "found 'p' modified, which is protected in A",
    ),
    (
        "model A\n  Real x = 1;\nend A;\nmodel B\n  Real z = 1;\nend B;\nmodel H\n  replaceable A a;\nend H;\nmodel M\n"
        "  H h(redeclare B a);\nend M;",
        "11:17",
        "found B for what A constrains, but it has no 'x'",
    ),
    (
        "connector U = input Real;\nconnector Y = output Boolean;\nmodel M\n  U u;\n  Y y = time > 1;\nequation\n"
        "  connect(u, y);\nend M;",
        "7:3",
        "found connectors of Real and Boolean",
    ),
)


@pytest.mark.parametrize(("text", "place", "words"), [*WRONG, *MEANINGS])
def test_wrong_text_is_refused_by_line_and_column(text, place, words, tmp_path):
    (tmp_path / "wrong.mo").write_text(text)
    line, column = place.split(":")
    with pytest.raises(ModelError, match=f"line {line}, column {column}: {words}"):
        gantrytau.flatten(load_modelica(tmp_path / "wrong.mo")["M"]())


PERIODS = """model M
  Integer count;
  Real begin;
  Integer seen(start=0);
initial algorithm
  count := integer(time / 0.25);
  begin := count * 0.25;
equation
  when time >= (pre(count) + 1) * 0.25 then
    count = pre(count) + 1;
    begin = time;
  end when;
  when {initial(), time > 0.4} then
    seen = pre(seen) + 1;
  end when;
  annotation(experiment(StartTime=0.3, StopTime=1.1));
end M;
"""


def test_initial_algorithms_and_whens_with_initial_act_at_the_start(tmp_path):
    (tmp_path / "periods.mo").write_text(PERIODS)
    found = simulate(load_modelica(tmp_path / "periods.mo")["M"]())
    begun = [found.at(t, n) for t in (0.35, 0.6, 1.05) for n in ("count", "begin", "seen")]
    np.testing.assert_allclose(
        begun, [1, 0.25, 1, 2, 0.5, 2, 4, 1.0, 2], atol=1e-7
    )  # of the instants' location


def test_what_is_final_has_no_other_value_and_a_flow_meets_flows(tmp_path):
    (tmp_path / "final.mo").write_text(
        "connector P\n Real v;\n flow Real i;\nend P;\nconnector Q\n Real v;\n Real i;\nend Q;\nmodel M\n P p;\n Q q;\n"
        "equation\n connect(p, q);\nend M;\nmodel F\n final parameter Real k = 1;\n Real x = k;\nend F;"
    )
    library = load_modelica(tmp_path / "final.mo")
    with pytest.raises(ModelError, match="'i' is a flow in one of them only"):
        gantrytau.flatten(library["M"]())
    with pytest.raises(ModelError, match="'k', which is declared final"):
        simulate(library["F"](), stop=1.0, parameters={"k": 2.0})


def test_a_library_in_folders_is_read_where_it_is_needed(tmp_path):
    (tmp_path / "Lib" / "Parts").mkdir(parents=True)
    (tmp_path / "Lib" / "package.mo").write_text("package Lib\nend Lib;")
    (tmp_path / "Lib" / "Parts" / "package.mo").write_text(
        "within Lib;\npackage Parts\nconstant Real k = 3;\nend Parts;"
    )
    (tmp_path / "Lib" / "Parts" / "Lag.mo").write_text(
        "within Lib.Parts;\nmodel Lag\n Real x(start=1, fixed=true);\nequation\n der(x) = -k * x;\nend Lag;"
    )
    (tmp_path / "Lib" / "Parts" / "Broken.mo").write_text("this is not Modelica")
    (tmp_path / "use.mo").write_text("model Use\n extends Lib.Parts.Lag(x(start=2));\nend Use;")
    use = load_modelica(tmp_path / "use.mo", libraries=[tmp_path])["Use"]
    assert simulate(use(), stop=1.0)["x"][-1] == pytest.approx(2 * np.exp(-3), rel=1e-7)


class Controlled(Model):
    x = Real(start=0.0, fixed=True)

    def equations(self):
        yield der(self.x) == gantrytau.limit(1.5 * (1 - self.x), -0.5, 0.5) + 0.1


class Quadratic(Model):
    x = Real(start=0.0, fixed=True)

    def equations(self):
        yield der(self.x) == 2 * (1 - self.x) ** 2 + 0.1


def test_functions_records_and_redeclared_models_compute_as_python_does():
    whole = load_modelica(HERE / "functions.mo")["Functions.Whole"]
    same(whole(), Controlled(), {"plain.x": "x"}, 1.0)
    same(whole(), Quadratic(), {"other.x": "x"}, 1.0)
    result = simulate(whole())
    x, t = result["plain.x"], result.time
    polynomial = 1 + 2 * x + 3 * x**2
    np.testing.assert_allclose(result["plain.y"][x < 0.49], -polynomial[x < 0.49], rtol=1e-12)
    np.testing.assert_allclose(result["plain.y"][x > 0.51], polynomial[x > 0.51], rtol=1e-12)
    np.testing.assert_allclose(result["z[3]"], 2 + 3 * t + 3, rtol=1e-12)
    np.testing.assert_allclose(result["w"], np.minimum(20 * t, 10), rtol=1e-12)
    assert (result["beyond"][0], result["beyond"][-1]) == (0, 1)
    again = simulate(whole(around=dict(wind=0.0)))
    assert again["plain.x"][-1] < x[-1]
    assert simulate(whole(), parameters={"g.limits": [-0.5, 0.6]})["plain.x"][-1] > x[-1]
