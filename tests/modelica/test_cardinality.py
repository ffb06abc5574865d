"""`cardinality`: connections are counted on both sides of a component, and choose equations."""

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
    when n == 1 then
      reinit(counted, pre(counted) + 10);
    elsewhen n <> 0 then
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
