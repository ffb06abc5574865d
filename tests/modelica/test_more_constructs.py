"""Arrays of components with two dimensions; classes that extend those of their names, and constants of packages."""

import numpy as np
import pytest

from gantrytau import ModelError, SolveError, load_modelica, simulate, translate


def loaded(folder, text: str):
    (folder / "text.mo").write_text(text)
    return load_modelica(folder / "text.mo")


GRID = """package Grids
  connector Pin
    Real v;
    flow Real i;
  end Pin;
  model Resistor
    Pin p, n;
    parameter Real R = 1;
    parameter Integer count = 1;
    Real w[count] = {k * p.i for k in 1:count};
  equation
    p.v - n.v = R * p.i;
    p.i + n.i = 0;
  end Resistor;
  model Source
    Pin p;
    parameter Real V = 0;
  equation
    p.v = V;
  end Source;
  model Grid
    Resistor b[2, 3](R = {{1, 2, 3}, {4, 5, 6}}, each count = 2), d[2, 2](R = fill(2, 2, 2), count = [1, 2; 3, 4]);
    Source left[2](V = {12, 30}), right;
    Real total = sum(b.p.i), column[2] = b[:, 2].p.i, last = b[end, end].w[2];
    parameter Integer sizes[2] = size(b);
  equation
    for i in 1:2 loop
      connect(left[i].p, b[i, 1].p);
      for j in 1:2 loop
        connect(b[i, j].n, b[i, j + 1].p);
      end for;
      connect(b[i, 3].n, right.p);
      connect(left[1].p, d[1, i].p);
      connect(d[2, i].n, right.p);
    end for;
    connect(d[1, :].n, d[2, :].p);
  end Grid;
  model Two
    Grid one(b(R = {{1, 1, 1}, {1, 1, 3}}), d(each R = 1));
  end Two;
end Grids;
"""


def test_components_in_rows_and_columns(tmp_path):
    library = loaded(tmp_path, GRID)
    result = simulate(library["Grids.Grid"](), stop=1.0)
    found = {n: result.final(n) for n in ("total", "column[2]", "last", "sizes[2]", "d[2,2].w[4]")}
    assert found == {"total": 12, "column[2]": 2, "last": 4, "sizes[2]": 3, "d[2,2].w[4]": 12}
    assert simulate(library["Grids.Grid"](), stop=1.0, parameters={"b[2,3].R": 21}).final("last") == 2
    result = simulate(library["Grids.Two"](), stop=1.0)
    assert [result.final(f"one.{n}.p.i") for n in ("b[1,2]", "b[2,2]", "d[1,2]")] == [4, 6, 6]


EXTENDED = """package Media
  partial package Base
    constant Real k = 2;
    replaceable model Balance
      parameter Real gain = 1;
      Real x(start = 1, fixed = true), y;
    equation
      der(x) = -gain * x;
    end Balance;
    replaceable partial function law
      input Real u;
      output Real v;
    end law;
    model Use
      Balance b;
      Real v = law(b.x);
    end Use;
  end Base;
  package Middle
    extends Base;
    redeclare replaceable model extends Balance(gain = k)
    equation
      y = x + shift;
    protected
      parameter Real shift = 10;
    end Balance;
    redeclare function extends law
    algorithm
      v := 3 * u;
    end law;
  end Middle;
  package Last
    extends Middle(k = 3);
    redeclare model extends Balance
      Real z = 2 * y;
    end Balance;
  end Last;
  model Chosen
    replaceable package Medium = Last;
    Real twice = 2 * Medium.law(Medium.k);
  end Chosen;
  model Inherited
    extends Base;
    model extends Other
    end Other;
    Other o;
  end Inherited;
end Media;
"""


def test_a_class_extends_the_one_of_its_name_and_has_the_constants_of_the_heir(tmp_path):
    library = loaded(tmp_path, EXTENDED)
    for package, k, doubled in (("Middle", 2, 0), ("Last", 3, 1)):
        result = simulate(library[f"Media.{package}.Use"](), stop=1.0)
        assert result.final("v") == pytest.approx(3 * np.exp(-k), rel=1e-6)
        y = (1 + doubled) * (np.exp(-k) + 10)
        assert result.final("b.z" if doubled else "b.y") == pytest.approx(y, rel=1e-6)
    assert simulate(library["Media.Chosen"](), stop=1.0).final("twice") == 18
    with pytest.raises(ModelError, match="'Other' behind 'extends', expected an inherited class"):
        library["Media.Inherited"]


INSTANTS = """package Instants
  record Losses
    parameter Real P = 1;
    final parameter Real linear = 0.1 * P;
  end Losses;
  model Machine
    parameter Losses losses;
    Real heat = losses.linear + losses.P;
  end Machine;
  model Held "y holds what was chosen last, without min and max"
    parameter Losses losses(P = 4);
    Machine machine(losses = losses);
    Boolean u[2] = {time > 1 and time < 2, time > 3 and time < 4};
    Integer y, n(start = 0), risen(start = 0), any(start = 0);
  initial equation
    pre(y) = 7;
  equation
    y = if u[1] then 20 elseif u[2] then -300 else pre(y);
    when change(u[1]) then
      n = pre(n) + 1;
    end when;
    when edge(u[2]) then
      risen = pre(risen) + 1;
    end when;
    when u then
      any = pre(any) + 1;
    end when;
  end Held;
  function after "the row behind x"
    input Real rows[:];
    input Real x;
    input Integer first;
    output Integer next;
  protected
    Integer n = size(rows, 1);
  algorithm
    next := first;
    while next < n and x >= rows[next] loop
      next := next + 1;
    end while;
  end after;
  model Buffer
    Integer k(start = 0), row(start = 1);
    Real buffer[4](each start = 0, each fixed = true), table[2, 2];
    parameter Integer shift = 0;
    Integer place(start = 1);
  algorithm
    when sample(0.5, 1) then
      k := pre(k) + 1;
      buffer[k + shift] := 10 * k;
      row := after({0.1, 1.1, 2.9, 9}, time, pre(row));
    end when;
    place := if time > 1 then 2 else 1;
    table := {{1, 2}, {3, 4}};
    table[place, :] := {time, 5};
  end Buffer;
  function interpolated
    input Real x, points[:, 2];
    output Real y;
  protected
    Integer i;
  algorithm
    i := 1;
    while x >= points[i + 1, 1] loop
      i := i + 1;
    end while;
    y := points[i, 2] + (x - points[i, 1]) / (points[i + 1, 1] - points[i, 1]) * (points[i + 1, 2] - points[i, 2]);
  end interpolated;
  model Hat
    Real y = interpolated(time, [0, 0; 1, 0; 2, 2; 3, 0; 4, 0]);
  end Hat;
  model Turns "the place of what is changed varies, too"
    Integer count[3](each start = 0), k(start = 1), older(start = 0);
  algorithm
    when sample(0.1, 0.2) then
      older := pre(count[k]);
      count[k] := pre(count[k]) + 1;
      k := mod(pre(k), 3) + 1;
    end when;
  end Turns;
  model Button "set at 1 and 3, reset at 2 and 3"
    Boolean on(start = false);
  algorithm
    when sample(2, 1) then
      on := false;
    end when;
    when sample(1, 2) then
      on := true;
    end when;
  end Button;
  model Counter "what comes between two samples; both set count, the later one wins where both act"
    discrete Integer count(start = 0), found(start = 0), every(start = 0);
    Real next;
  initial equation
    next = 0.125;
  algorithm
    when time >= pre(next) then
      next := time + 0.125;
      count := pre(count) + 1;
      every := pre(every) + 1;
    end when;
    when sample(0.5, 0.5) then
      found := pre(count);
      count := 0;
    end when;
  end Counter;
  model Sampled
    Integer n(start = 0), m(start = 0);
    Real last(start = -1);
  equation
    when sample(-0.3, 1) then
      n = pre(n) + 1;
      last = time;
    end when;
    when sample(2, 0.5) then
      m = pre(m) + 1;
    end when;
  end Sampled;
end Instants;
"""


@pytest.fixture
def instants(tmp_path):
    return loaded(tmp_path, INSTANTS)


def test_an_integer_without_limits_is_held_and_elements_change(instants):
    result = simulate(instants["Instants.Held"](), stop=5.0)
    assert [float(result.at(t, "y")) for t in (0.5, 1.5, 2.5, 3.5, 4.5)] == [7, 20, 20, -300, -300]
    assert [result.final(name) for name in ("n", "risen", "any")] == [2, 1, 2]
    assert result.final("machine.heat") == pytest.approx(4.4)  # 0.1 * 4 + 4: what is final stays


def test_subscripts_that_vary_are_assigned_and_loops_of_varying_length_end(instants):
    result = simulate(instants["Instants.Buffer"](), stop=3.0)
    assert [result.final(f"buffer[{k}]") for k in (1, 2, 3, 4)] == [10, 20, 30, 0]
    assert [float(result.at(t, "row")) for t in (0.7, 1.7, 2.7)] == [2, 3, 3]
    assert [float(result.at(0.5, name)) for name in ("table[1,1]", "table[2,2]")] == [0.5, 4]
    assert [float(result.at(1.5, name)) for name in ("table[1,1]", "table[2,1]", "table[2,2]")] == [1, 1.5, 5]
    hat = simulate(instants["Instants.Hat"](), stop=3.5)
    np.testing.assert_allclose(hat.at(np.array([0.5, 1.25, 2.5, 3.5]), "y"), [0, 0.5, 1, 0], atol=1e-6)
    with pytest.raises(SolveError):
        simulate(instants["Instants.Buffer"](), stop=3.0, parameters={"shift": 2})


def test_the_value_before_an_instant_at_the_place_of_now(instants):
    result = simulate(instants["Instants.Turns"](), stop=1.0)
    assert [result.final(f"count[{k}]") for k in (1, 2, 3)] == [2, 2, 1]
    assert (result.final("k"), result.final("older")) == (3, 1)


def test_the_later_of_two_whens_of_an_algorithm_wins(instants):
    result = simulate(instants["Instants.Button"](), stop=3.9)
    assert [float(result.at(t, "on")) for t in (0.5, 1.5, 2.5, 3.5)] == [0, 1, 0, 1]


def test_whens_of_an_algorithm_that_set_one_variable_alike_keep_the_others(instants):
    result = simulate(instants["Instants.Counter"](), stop=1.2)
    assert [float(result.at(t, "found")) for t in (0.4, 0.6, 1.1)] == [0, 3, 3]
    assert [float(result.at(t, "count")) for t in (0.4, 0.6, 0.8, 1.1)] == [3, 0, 2, 0]
    assert result.final("every") == 9


def test_a_sample_that_starts_before_the_run_fires_at_its_next_instant(instants):
    found = [simulate(instants["Instants.Sampled"](), start=t, stop=t + 1.5) for t in (0.0, 0.7, 2.1)]
    assert [(one.final("n"), one.final("m")) for one in found] == [(1, 0), (2, 1), (1, 3)]
    assert [round(one.final("last"), 9) for one in found] == [0.7, 1.7, 2.7]
    text = translate(instants["Instants.Sampled"](), events=True).equations("base-modelica")
    assert all(words in text for words in ("sample(-0.3, 1)", "sample(2, 0.5)"))


BUSES = """package Buses
  connector Out = output Real; connector In = input Real;
  connector Pin
    Real v;
    flow Real i;
  end Pin;
  expandable connector Bus
    Real speed "declared, and connected";
    Integer spare "declared, and missing";
    Bus2 inner_bus;
  end Bus;
  expandable connector Bus2 end Bus2;
  model Source
    parameter Real k;
    Out y = k * time;
  end Source;
  model Sink
    In u;
    Real twice = 2 * u;
  end Sink;
  model Load
    parameter Real above = 0;
    Pin p;
  equation
    p.i = p.v - above;
  end Load;
  model Unit
    Bus bus;
    Bus2 small;
    Source s(k = 3), t(k = 4), w[2](k = {5, 6});
    Load load(above = 1);
  equation
    connect(s.y, bus.fresh);
    connect(t.y, small.deep);
    for k in 1:2 loop
      connect(w[k].y, bus.many[k]);
    end for;
    connect(load.p, bus.pin);
  end Unit;
  model Whole
    Unit unit;
    Bus bus;
    Source speed(k = 2);
    Sink a, b, c, d;
    Load ground;
  equation
    connect(unit.bus, bus);
    connect(unit.small, bus.inner_bus);
    connect(speed.y, bus.speed);
    connect(bus.speed, a.u);
    connect(b.u, bus.fresh);
    connect(bus.inner_bus.deep, c.u);
    connect(bus.many[2], d.u);
    connect(ground.p, bus.pin);
  end Whole;
  model Rows "arrays of components, and parts of them, as a whole"
    Bus bus;
    Source s[4](k = {1, 2, 3, 4});
    Sink a[2], b[2];
    In none[0];
    Out nothing[0];
  equation
    connect(s[1:3].y, bus.row);
    connect(bus.row[2:3], a.u);
    connect(s[3:4].y, b.u);
    connect(none, nothing);
  end Rows;
  model Wrong
    Bus bus;
    Source s[3];
    Sink a[2];
  equation
    connect(s.y, bus.row);
    connect(bus.row, a.u);
  end Wrong;
end Buses;
"""


def test_an_expandable_connector_has_what_is_connected_to_it(tmp_path):
    library = loaded(tmp_path, BUSES)
    result = simulate(library["Buses.Whole"](), stop=1.0)
    assert [result.final(f"{name}.twice") for name in "abcd"] == [4, 6, 8, 12]
    assert [result.final(name) for name in ("unit.bus.speed", "ground.p.v")] == pytest.approx([2, 0.5])
    assert not any("spare" in name for name in result.names)
    result = simulate(library["Buses.Rows"](), stop=1.0)
    assert [result.final(f"{name}.twice") for name in ("a[1]", "a[2]", "b[2]")] == [4, 6, 8]
    with pytest.raises(ModelError, match=r"found connectors of the sizes \[3\] and \[2\], expected one size"):
        simulate(library["Buses.Wrong"](), stop=1.0)


GUESSED = """package Guessed
  model Lag
    parameter Real begins = 0 "where it starts";
    Real y(start = begins);
  initial equation
    y = begins;
  equation
    der(y) = 1 - y;
  end Lag;
  model Base
    parameter Real k = 2 "in the base";
  end Base;
  model Whole
    extends Base;
    parameter Real k = 2 "the same, told otherwise";
    parameter Real found(fixed = false);
    Lag lag(begins = found);
  initial equation
    found = 2 * k;
  end Whole;
end Guessed;
"""


def test_a_guess_that_initial_equations_determine_is_left_to_them(tmp_path):
    result = simulate(loaded(tmp_path, GUESSED)["Guessed.Whole"](), stop=1.0)
    assert result.at(0.0, "lag.y") == pytest.approx(4)


CHOICES = """package Choices
  type E = enumeration(a, b, c);
  model M
    E last[2] = E.b:E.c;
    Real x[3] = {if k == E.b then time else 0 for k in E.a:E.c}, y[E];
  equation
    for k in E.a:E.c loop
      y[k] = if k <> E.c then Integer(k) else 10;
    end for;
  end M;
end Choices;
"""


def test_a_range_of_an_enumeration_holds_its_values(tmp_path):
    result = simulate(loaded(tmp_path, CHOICES)["Choices.M"](), stop=1.0)
    assert [result.final(n) for n in ("last[1]", "x[1]", "x[2]", "y[2]", "y[3]")] == [2, 0, 1, 2, 10]
