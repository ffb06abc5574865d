"""`cardinality` on both sides of a component; steps as graphs of states have them: conditions and values at the start."""

from gantrytau import load_modelica, simulate

TEXT = """package Lines
  connector Pin
    Real v;
    flow Real i;
  end Pin;
  model Grounding
    Pin p[2], q;
    Real count[3] = {cardinality(p[1]), cardinality(p[2]), cardinality(q)};
    Inner inside;
  equation
    for k in 1:2 loop
      if cardinality(p[k]) == 0 then
        p[k].v = 7;
      else
        p[k].i = p[k].v - 1;
      end if;
    end for;
    connect(inside.r, q);
  end Grounding;
  model Inner
    Pin r;
  equation
    r.i = r.v;
  end Inner;
  model Whole
    Grounding g;
    Inner a[3];
  equation
    for k in 1:2 loop
      connect(g.p[1], a[k].r);
    end for;
    if size(a, 1) > 2 then
      connect(a[3].r, g.q);
    end if;
  end Whole;
  model Steps
    Integer n;
    Real x(start = 0, fixed = true), counted(start = 0, fixed = true);
  equation
    der(x) = 1;
    der(counted) = 0;
    n = if x < 1 then 0 else if x < 2 then 1 else 2;
    when n == 1 or n == 7 then
      reinit(counted, pre(counted) + 10);
    elsewhen n <> 0 and x > 0 then
      reinit(counted, pre(counted) + 1);
    end when;
  end Steps;
end Lines;
"""


def test_connections_are_counted_in_loops_and_conditions_outside_and_inside(tmp_path):
    (tmp_path / "lines.mo").write_text(TEXT)
    result = simulate(load_modelica(tmp_path / "lines.mo")["Lines.Whole"](), stop=1.0)
    assert [result.final(f"g.count[{k}]") for k in (1, 2, 3)] == [2, 0, 2]
    assert result.final("g.p[2].v") == 7


def test_an_integer_that_equals_a_value_for_a_while_is_a_condition_of_when(tmp_path):
    (tmp_path / "lines.mo").write_text(TEXT)
    result = simulate(load_modelica(tmp_path / "lines.mo")["Lines.Steps"](), stop=3.0)
    assert [float(result.at(t, "counted")) for t in (0.5, 1.5, 2.5)] == [0, 10, 10]


STEPS = """package Grafcet
  model Step
    output Boolean active, localActive;
    Boolean newActive;
    input Boolean set, reset;
    parameter Boolean first = false;
  initial equation
    active = first;
    pre(newActive) = pre(localActive);
  equation
    active = localActive;
    localActive = pre(newActive);
    newActive = set or localActive and not reset;
    when false then
      terminate("never");
    end when;
  end Step;
  model Whole
    Step a(first = true), b;
    Boolean fire;
  equation
    fire = a.localActive and time > 1;
    a.set = false;
    a.reset = fire;
    b.set = fire;
    b.reset = false;
  end Whole;
end Grafcet;
"""


def test_an_initial_value_reaches_what_it_equals_before_the_start(tmp_path):
    (tmp_path / "steps.mo").write_text(STEPS)
    result = simulate(load_modelica(tmp_path / "steps.mo")["Grafcet.Whole"](), stop=2.0)
    states = [[float(result.at(t, f"{name}.active")) for t in (0.5, 1.5)] for name in "ab"]
    assert states == [[1, 0], [0, 1]]


STAGES = """package Stages
  model Stage "on from set until reset, each a round of the instant later"
    parameter Boolean first = false;
    Boolean on, next, set, reset;
  initial equation
    pre(next) = pre(on);
    on = first;
  equation
    on = pre(next);
    next = set or on and not reset;
  end Stage;
  model Passage "lets go on 1 s after it was reached"
    Boolean reached, goes;
    discrete Real begun;
  initial equation
    pre(begun) = time;
    pre(reached) = false;
  equation
    when reached then
      begun = time;
    end when;
    goes = reached and time >= begun + 1;
  end Passage;
  model Circle
    Stage stage[3](first = {true, false, false});
    Passage passage[3];
  equation
    for k in 1:3 loop
      passage[k].reached = stage[k].on and not stage[mod(k, 3) + 1].on;
      stage[k].reset = passage[k].goes;
      stage[mod(k, 3) + 1].set = passage[k].goes;
    end for;
  end Circle;
  connector Port
    Real v;
    flow Real n;
  end Port;
  model Root
    parameter Real share = 1;
    Port p;
  equation
    p.v = 0;
  end Root;
  model Source
    Port p(n = share);
    parameter Real share = 1;
  end Source;
  model Member
    outer Root root;
    Source own(share = root.share);
  equation
    connect(own.p, root.p);
  end Member;
  model Group
    inner outer Root root(share = 2);
    Source own(share = root.share);
    Member member[3];
  equation
    connect(own.p, root.p);
  end Group;
  model Whole
    inner Root root(share = 5);
    Group group;
  end Whole;
end Stages;
"""


def test_a_time_that_begins_with_a_stage_is_known_before_the_next_one(tmp_path):
    (tmp_path / "stages.mo").write_text(STAGES)
    result = simulate(load_modelica(tmp_path / "stages.mo")["Stages.Circle"](), stop=5.0)
    on = [[result.at(t, f"stage[{k}].on") for k in (1, 2, 3)] for t in (0.5, 1.5, 2.5, 3.5, 4.5)]
    assert on == [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0]]


def test_what_is_inner_and_outer_is_for_its_class_the_one_around_it(tmp_path):
    (tmp_path / "stages.mo").write_text(STAGES)
    result = simulate(load_modelica(tmp_path / "stages.mo")["Stages.Whole"](), stop=1.0)
    assert [result.final(name) for name in ("root.p.n", "group.root.p.n")] == [-5, -6]
