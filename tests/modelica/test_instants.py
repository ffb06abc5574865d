"""What Modelica text does at instants: starts, samples, values before and behind, friction, and tables that jump."""

import numpy as np
import pytest
import scipy.io

from gantrytau import ModelError, SolveError, load_modelica, simulate

STICKING = """model M "unit mass on dry friction of 2 N, pushed by 3 N behind 2 s"
  Real v(start=1, fixed=true), a, sa, f;
  Integer mode(min=0, max=1, start=0);
  Boolean forward, locked;
equation
  der(v) = a;
  a = (if time > 2 then 3 else 0) - f;
  forward = pre(mode) == 0 and (sa > 2 or pre(forward) and sa > 2) or initial() and v > 0;
  locked = not (pre(mode) == 1 or forward);
  a = if locked then 0 else sa - 2;
  f = if locked then sa else 2;
  mode = if (pre(mode) == 1 or forward) and v > 0 then 1 else 0;
end M;
"""


def test_friction_by_a_mode_that_remembers_sticks_and_breaks_away(tmp_path):
    (tmp_path / "sticking.mo").write_text(STICKING)
    found = simulate(load_modelica(tmp_path / "sticking.mo")["M"](), stop=3.0)
    np.testing.assert_allclose(found.at(np.array([0.25, 1.0, 1.9, 3.0]), "v"), [0.5, 0, 0, 1], atol=1e-6)


TABLE = """type Smoothness = enumeration(LinearSegments, ContinuousDerivative, ConstantSegments);
type Extrapolation = enumeration(HoldLastPoint, LastTwoPoints, Periodic);
class Held
  extends ExternalObject;
  function constructor
    input String tableName;
    input String fileName;
    input Real table[:, :];
    input Integer columns[:];
    input Smoothness smoothness;
    input Extrapolation extrapolation;
    input String delimiter = ",";
    input Integer nHeaderLines = 1;
    output Held held;
    external "C" held = ModelicaStandardTables_CombiTable1D_init3(fileName, tableName, table);
  end constructor;
end Held;
function unknown
  input String text;
  output Boolean found;
  external "C" found = unknown_in_c(text);
end unknown;
function value
  input Held held;
  input Integer column;
  input Real u;
  output Real y;
  external "C" y = ModelicaStandardTables_CombiTable1D_getValue(held, column, u);
end value;
model M
  parameter Real numbers[:, :] = {{0, 0, 5}, {1, 2, 6}, {1, 4, 7}, {2, 4, 8}};
  parameter Smoothness smoothness = Smoothness.LinearSegments;
  parameter Extrapolation beyond = Extrapolation.HoldLastPoint;
  parameter String file = if false and unknown("") then "file" else "NoName";
  parameter String name = "NoName";
  parameter Held held = Held(name, file, numbers, {2, 3}, smoothness, beyond);
  Real y = value(held, 1, time);
end M;
"""


@pytest.mark.parametrize(
    ("smoothness", "beyond", "wanted"),
    [
        ("LinearSegments", "HoldLastPoint", [1, 4, 4, 4]),
        ("ConstantSegments", "HoldLastPoint", [0, 4, 4, 4]),
        ("ConstantSegments", "LastTwoPoints", [0, 4, 4, 4]),
        ("LinearSegments", "LastTwoPoints", [1, 4, 4, 4]),
        ("LinearSegments", "Periodic", [1, 4, 1, 4]),
    ],
)
def test_tables_are_read_by_external_functions(smoothness, beyond, wanted, tmp_path):
    (tmp_path / "table.mo").write_text(TABLE)
    model = load_modelica(tmp_path / "table.mo")["M"](smoothness=smoothness, beyond=beyond)
    found = simulate(model, stop=4.0)
    np.testing.assert_allclose(found.at(np.array([0.5, 1.5, 2.5, 3.5]), "y"), wanted, atol=1e-9)


@pytest.mark.parametrize("ending", ["txt", "csv", "mat"])
def test_tables_of_files_are_those_of_the_model(ending, tmp_path):
    numbers, file = np.array([[0, 4.0], [1, 6.0], [3, 8.0], [4, 8.0]]), tmp_path / f"points.{ending}"
    if ending == "mat":
        scipy.io.savemat(file, {"of": {"points": numbers}})
    else:
        head = "#1\ndouble other(1,2) # first\n7 8\ndouble points(4,2) # second" if ending == "txt" else "x,y"
        between = "\t" if ending == "txt" else ","
        np.savetxt(file, numbers, header=head, comments="", delimiter=between)
    (tmp_path / "table.mo").write_text(TABLE.replace("{1, 4, 7}, {2, 4, 8}", "{3, 4, 7}, {4, 4, 8}"))
    made = load_modelica(tmp_path / "table.mo")["M"]
    found, wanted = (
        simulate(made(smoothness="ContinuousDerivative", **said), stop=4.0)
        for said in ({"file": str(file), "name": "of.points" if ending == "mat" else "points"}, {})
    )
    np.testing.assert_allclose(found["y"], wanted["y"] + 4, rtol=0, atol=1e-14)


def test_a_table_that_a_file_has_not_is_refused_with_the_file(tmp_path):
    (tmp_path / "points.txt").write_text("#1\ndouble points(1,2)\n7 8\n")
    (tmp_path / "table.mo").write_text(TABLE)
    made = load_modelica(tmp_path / "table.mo")["M"]
    for file, words in (("points.txt", "no matrix 'point'"), ("none.txt", "no file of a table")):
        with pytest.raises(ModelError, match=words):
            simulate(made(file=str(tmp_path / file), name="point"), stop=1.0)


TOGETHER = """model M
  Boolean b = time > 0.25;
  Integer pair[2](each start=0), n(start=0), few(start=0), many(start=0), edges(start=0), before(start=0);
equation
  when sample(0.1, 0.1) then
    n = pre(n) + 1;
  end when;
  when sample(0.1, 0.1) and n < 3 then
    few = pre(few) + 1;
    pair = {few, n};
  end when;
  when n > 2 and sample(0.1, 0.1) then
    many = pre(many) + 1;
  end when;
  when edge(b) and n > 5 then
    edges = pre(edges) + 1;
  end when;
  when time > 0.25 then
    before = if pre(b) then 1 else 2;
  end when;
end M;
"""


def test_what_stands_beside_an_instant_has_the_new_values_and_pre_the_old_ones(tmp_path):
    (tmp_path / "together.mo").write_text(TOGETHER)
    found = simulate(load_modelica(tmp_path / "together.mo")["M"](), stop=0.55)
    assert [found.final(n) for n in ("n", "few", "many", "edges", "before")] == [5, 2, 3, 0, 2]
    assert found.final("pair").tolist() == [2, 2]


PERIODS = """model M
  Integer count, ticks(start=0);
  Real begin;
  parameter Real t0(fixed=false);
  Integer seen(start=0);
initial equation
  t0 = time;
initial algorithm
  count := integer(time / 0.25);
  begin := count * 0.25;
equation
  when time >= (pre(count) + 1) * 0.25 then
    count = pre(count) + 1;
    begin = time;
  end when;
  when sample(t0 + 0.1, 0.5) then
    ticks = pre(ticks) + 1;
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


@pytest.mark.parametrize(
    "start",
    [
        "initial equation x = t; t = 2; h = 3 * x; j = if x > 1 then 4 else 5;",
        "initial equation x = t; t = 2; pre(h) = 3 * t; pre(j) = if x > 1 then 4 else 5;",
        "initial algorithm t := 2; x := t; h := 3 * x; j := if x > 1 then 4 else 5;",
    ],
)
def test_what_a_when_sets_starts_from_variables(tmp_path, start):
    declared = "parameter Real t(fixed=false); Real x; discrete Real h; Integer j;"
    acts = "when time > 0.5 then h = pre(h) + 1; j = pre(j) + 1; end when;"
    (tmp_path / "m.mo").write_text(f"model M {declared} {start} equation der(x) = -x; {acts} end M;")
    found = simulate(load_modelica(tmp_path / "m.mo")["M"](), stop=1.0)
    np.testing.assert_allclose(found.at(np.array([0.2, 0.8]), "h"), [6, 7], rtol=1e-9)
    np.testing.assert_allclose(found.at(np.array([0.2, 0.8]), "j"), [4, 5], rtol=1e-9)


def test_an_enumeration_that_varies_has_a_number_and_sizes_an_array(tmp_path):
    (tmp_path / "p.mo").write_text(
        """package P
          type Gear = enumeration(low, high);
          model M
            Gear gear(start=Gear.low, fixed=true);
            Real ratios[Gear] = {3, 1}, number = Integer(gear), last = ratios[Gear.high];
          equation
            when time > 0.5 then gear = Gear.high; end when;
          end M;
        end P;"""
    )
    found = simulate(load_modelica(tmp_path / "p.mo")["P.M"](), stop=1.0)
    assert [*found.at(np.array([0.2, 0.8]), "number"), *found.at(np.array([0.2]), "last")] == [1, 2, 1]


CHANGES = """type Gear = enumeration(low, high);
block Counter
  input Boolean u;
  input Integer k;
  output Integer n(start=0), step(start=0);
equation
  when change(u) then
    n = pre(n) + 1;
  end when;
  when change(k) then
    step = k - pre(k);
  end when;
end Counter;
model M
  Boolean up = time > 1, rises = edge(up), late = time > 2;
  Integer whole = integer(time), k(start=0), j(start=0), twice, sum;
  Gear gear = if time < 1.5 then Gear.low else Gear.high;
  Integer risen(start=0), both(start=0), shifts(start=0), seen(start=0), last(start=0), set(start=0);
  Real x(start=0, fixed=true);
  Counter counter(u=up, k=if time < 1 then 5 elseif time < 2 then 8 else 2);
equation
  der(x) = pre(whole) + (if edge(up) then 1 else 0);
  when rises then
    risen = pre(risen) + 1;
  end when;
  when edge(up) or late and not pre(late) then
    both = pre(both) + 1;
  end when;
  when change(gear) then
    shifts = pre(shifts) + 1;
  end when;
  when time >= 2 then
    last = whole - pre(whole);
  end when;
  when sample(1, 1) then
    k = pre(k) + 3;
  end when;
  when change(k) then
    set = k - pre(k);
  end when;
  when sum >= 6 then
    j = 1;
  end when;
  twice = 2 * j;
  sum = k + twice;
  when change(sum) then
    seen = sum;
  end when;
end M;
"""


def test_edges_and_changes_are_seen_at_the_instant_they_happen(tmp_path):
    (tmp_path / "changes.mo").write_text(CHANGES)
    found = simulate(load_modelica(tmp_path / "changes.mo")["M"](), stop=2.75)
    wanted = dict(risen=1, both=2, shifts=1, last=1, set=3, seen=8, x=2.5)
    np.testing.assert_allclose([found.final(name) for name in wanted], [*wanted.values()], atol=1e-7)
    counted = found.at(np.array([0.5, 1.5, 2.5]), "counter.n"), found.at(np.array([1.5, 2.5]), "counter.step")
    assert [one.tolist() for one in counted] == [[0, 1, 1], [3, -6]]


STEPS = """model M
  Boolean late = time > 2.5;
  Integer n(start=0), k(start=0), guarded(start=0), v[2](each start=0), last(start=0);
  Real x(start=0, fixed=true), y;
equation
  der(x) = 1;
  when sample(0, 1) then
    if late then
      reinit(x, 0);
    else
      n = pre(n) + 1;
      for i in 1:2 loop
        v[i] = pre(v[i]) + i;
      end for;
    end if;
    assert(x < 9, "too far");
  end when;
  when sample(0, 1) and n > 2 then
    guarded = pre(guarded) + 1;
  elsewhen time >= 1 then
    guarded = pre(guarded) + 100;
  end when;
  when x > 0.8 then
    if late then
      terminate("done");
    end if;
  end when;
algorithm
  y := n;
  when sample(0, 1) then
    k := k + 1;
    if k > 2 then
      k := 10 * k;
    end if;
  elsewhen time > 1.5 then
    k := 7;
  end when;
  when k >= 7 then
    last := k;
  end when;
  y := y + k;
end M;
"""


def test_whens_hold_conditions_loops_checks_and_algorithms(tmp_path):
    (tmp_path / "steps.mo").write_text(STEPS)
    found = simulate(load_modelica(tmp_path / "steps.mo")["M"](), stop=9.0)
    assert found.ended == "done"
    np.testing.assert_allclose(found["time"][-1], 3.8, atol=1e-9)
    names = ("n", "guarded", "k", "last", "y")
    assert [found.final(name) for name in names] == [3, 102, 810, 7, 813]
    assert found.final("v").tolist() == [3, 6]


def test_an_assertion_in_a_when_is_looked_at_where_it_acts(tmp_path):
    text = 'model M Real x = time; equation when time > 1 then assert(x < 0.5, "too far"); end when; end M;'
    (tmp_path / "m.mo").write_text(text)
    with pytest.raises(SolveError, match="too far"):
        simulate(load_modelica(tmp_path / "m.mo")["M"](), stop=2.0)


def test_a_subscript_that_varies_chooses_and_none_beyond_is_taken(tmp_path):
    text = """model M
      parameter Real v[3] = {1, 4, 9};
      Integer i(start=1);
      Real m[2, 2] = [1, 2; 3, time], column[2] = m[:, i], x(start=0, fixed=true);
    equation
      der(x) = v[integer(time) + 1];
      when time > 1.5 then i = 2; end when;
    end M;"""
    (tmp_path / "m.mo").write_text(text)
    model = load_modelica(tmp_path / "m.mo")["M"]()
    found = simulate(model, stop=2.75)
    np.testing.assert_allclose(found.at(np.array([1.0, 2.0, 2.5]), "x"), [1, 5, 9.5], atol=1e-9)
    np.testing.assert_allclose(found.at(np.array([1.0, 2.5]), "column[2]"), [3, 2.5], atol=1e-9)
    with pytest.raises(SolveError, match="stopped at t = 3 s"):
        simulate(model, stop=4.0)


def test_a_fixed_start_of_a_boolean_is_its_value_before_the_start(tmp_path):
    (tmp_path / "b.mo").write_text(
        "model B Boolean b(start=true, fixed=true), c; Real x(start=0, fixed=true);"
        " equation b = time > 1; c = edge(b); der(x) = if b then 1 else 0; end B;"
    )
    found = simulate(load_modelica(tmp_path / "b.mo")["B"](), stop=2.0)
    assert (found["b"][0], found.final("b"), found.final("x")) == (0, 1, pytest.approx(1.0, abs=1e-6))


def test_what_remembers_sees_a_pulse_of_one_round_beside_a_when(tmp_path):
    (tmp_path / "p.mo").write_text(
        "model P Boolean up, pulse, y; Integer n(start=0); initial equation pre(y) = false;"
        " equation up = time > 1; pulse = edge(up); y = pulse or pre(y);"
        " when time > 1 then n = pre(n) + 1; end when; end P;"
    )
    found = simulate(load_modelica(tmp_path / "p.mo")["P"](), stop=2.0)
    assert [found["y"][0], found.final("y"), found.final("n")] == [0, 1, 1]
