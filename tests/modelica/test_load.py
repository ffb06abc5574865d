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
    translate,
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


def test_initial_equations_determine_a_parameter_that_is_not_fixed(tmp_path):
    (tmp_path / "found.mo").write_text(
        "model M\n parameter Real k(fixed=false, start=1);\n Real x(start=2, fixed=true);\ninitial equation\n k * k = 9;\n"
        "equation\n der(x) = -k * x;\nend M;"
    )
    found = simulate(load_modelica(tmp_path / "found.mo")["M"](), stop=1.0)
    assert found.final("x") == pytest.approx(2 * np.exp(-3), rel=1e-6)


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


def test_a_file_within_a_package_comes_before_it_and_names_the_class_of_its_name(tmp_path):
    (tmp_path / "use.mo").write_text("within Lag;\nmodel Use\n extends Lag.Lag(k=2);\nend Use;")
    (tmp_path / "lag.mo").write_text(
        "package Lag\nmodel Lag\n parameter Real k;\n Real x(start=1, fixed=true);\nequation\n der(x) = -k*x;\nend Lag;\n"
        "end Lag;"
    )
    library = load_modelica(tmp_path / "use.mo", tmp_path / "lag.mo")
    assert library.names == tuple(library) == ("Lag.Lag", "Lag.Use")
    assert simulate(library["Lag.Use"](), stop=1.0)["x"][-1] == pytest.approx(np.exp(-2), rel=1e-7)


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
    for part in (
        "Parts/Lag.mo",
        "Parts/package.mo",
        "Parts",
        "package.mo",
        ".",
    ):  # each brings the whole package
        library = load_modelica(tmp_path / "Lib" / part, tmp_path / "Lib" / "Parts" / "Lag.mo")
        assert library.names == ("Lib.Parts.Lag",)


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


def test_attributes_of_a_type_are_those_of_each_element_of_an_array(tmp_path):
    (tmp_path / "levels.mo").write_text(
        "model Levels type Level = Real(min=0, start=2); Level h[3](each fixed=true); equation der(h) = -h; end Levels;"
    )
    levels = simulate(load_modelica(tmp_path / "levels.mo")["Levels"](), stop=1.0, tolerance=1e-10)
    np.testing.assert_allclose([levels.final(f"h[{k}]") for k in (1, 2, 3)], 2 * np.exp(-1.0), rtol=1e-8)


def test_some_elements_of_an_array_have_fixed_starts(tmp_path):
    (tmp_path / "f.mo").write_text(
        """model Halves Real x[2, 2](each start=1); equation der(x) = -x; end Halves;
        model F
          Halves h[2](x(start={{{1, 2}, {3, 4}}, {{5, 6}, {7, 8}}},
            fixed={{{true, false}, {true, true}}, {{false, true}, {false, false}}}));
        initial equation
          sum(h[1].x) = 20; h[2].x[1, 1] = 9; h[2].x[2, :] = {h[1].x[1, 1], 0};
        end F;
        model G Real x[3](fixed={true, false}); equation der(x) = -x; end G;"""
    )
    library = load_modelica(tmp_path / "f.mo")
    start = translate(library["F"]()).start
    for k, wanted in ((1, [[1, 12], [3, 4]]), (2, [[9, 6], [1, 0]])):
        found = [[start[f"h[{k}].x[{i},{j}]"] for j in (1, 2)] for i in (1, 2)]
        np.testing.assert_allclose(found, wanted, atol=1e-9)
    with pytest.raises(ModelError, match=r"x: fixed has shape \(2,\), expected \(3,\)"):
        translate(library["G"]())


def test_a_constraint_of_a_class_modifies_what_replaces_it(tmp_path):
    (tmp_path / "p.mo").write_text(
        """package P
          model A parameter Real k = 1, y = 10 * k; end A;
          model B extends A(k = 5); parameter Real more = 7; end B;
          model H replaceable model X = A constrainedby A(k = 2); X x; end H;
          model M
            H plain, over(x(k = 3));
            H other(redeclare model X = B), own(redeclare model X = B(k = 4));
          end M;
        end P;"""
    )
    found = simulate(load_modelica(tmp_path / "p.mo")["P.M"](), stop=1.0)
    values = [found.at(np.array([1.0]), f"{name}.x.y")[0] for name in ("plain", "over", "other", "own")]
    assert values == [20, 30, 20, 40]


def test_a_derivative_whose_factor_is_evaluated_to_zero_asks_for_none(tmp_path):
    (tmp_path / "c.mo").write_text(
        "model C parameter Real c = 0 annotation(Evaluate=true); Real u, i;"
        " equation u = sin(time) + abs(cos(time)); i = c * der(u); end C;"
    )
    made = load_modelica(tmp_path / "c.mo")["C"]
    assert [max(translate(made(c=c)).indexed.counts) for c in (0, 2)] == [0, 1]


def test_a_copy_of_a_library_that_is_too_old_or_not_whole_is_told(tmp_path):
    (tmp_path / "Lib" / "Parts").mkdir(parents=True)
    order, package = tmp_path / "Lib" / "package.order", tmp_path / "Lib" / "package.mo"
    order.write_text("k\nParts\n")
    package.write_text('package Lib\n constant Real k = 3;\n annotation(version="3.2.3");\nend Lib;')
    use = tmp_path / "use.mo"
    text = 'model Use\n Lib.Parts.Lag lag;\n annotation(uses(Lib(version="{}")));\nend Use;'
    for asked, words in (
        ("4.0.0", r"^found Lib of version 3\.2\.3 in .*Lib, expected 4\.0\.0 or later, which Use uses"),
        ("3.2", r"Lib: found no Parts\.mo and no folder Parts with package\.mo, expected one"),
        ("3.2.3", "this copy of the package is not whole$"),
    ):
        use.write_text(text.format(asked))
        with pytest.raises(ModelError, match=words):
            load_modelica(use, libraries=[tmp_path])["Use"]


def test_of_several_versions_of_a_library_the_latest_is_taken(tmp_path):
    for version in ("9.0", "10.0"):
        folder = tmp_path / f"L {version}"
        folder.mkdir()
        (folder / "package.mo").write_text("package L\nend L;")
        (folder / "A.mo").write_text(f"within L;\nmodel A\n  Real x = {version};\nend A;")
        (folder / "B.mo").write_text("within L;\nmodel C\nend C;")
    (tmp_path / "m.mo").write_text("model M\n  L.A a;\nend M;\nmodel N\n  L.B b;\nend N;")
    library = load_modelica(tmp_path / "m.mo", libraries=[tmp_path])
    assert simulate(library["M"](), stop=1.0).final("a.x") == 10
    with pytest.raises(
        ModelError,
        match=r"line 2, column 7: found 'L\.C' in the file B\.mo of L, expected the one class L\.B",
    ):
        library["N"]


def test_a_sum_of_a_machine_has_as_many_terms_as_it_likes(tmp_path):
    (tmp_path / "m.mo").write_text(f"model M\n  Real x = {' + '.join(['time'] * 2000)};\nend M;")
    assert simulate(load_modelica(tmp_path / "m.mo")["M"](), stop=1.0).final("x") == 2000
