"""Operator records: their functions, conversions of numbers, arrays of them, and what is refused."""

import numpy as np
import pytest

from gantrytau import ModelError, load_modelica, simulate

TEXT = """
operator record Pair "a number with a real and an imaginary part"
  Real re;
  Real im;
  encapsulated operator 'constructor'
    function fromReal
      import Pair;
      input Real re;
      input Real im = 0;
      output Pair result(re = re, im = im);
    algorithm
    end fromReal;
  end 'constructor';
  encapsulated operator function '+'
    import Pair;
    input Pair a;
    input Pair b;
    output Pair c;
  algorithm
    c := Pair(a.re + b.re, a.im + b.im);
  end '+';
  encapsulated operator '-'
    function negate
      import Pair;
      input Pair a;
      output Pair c;
    algorithm
      c := Pair(-a.re, -a.im);
    end negate;
    function subtract
      import Pair;
      input Pair a;
      input Pair b;
      output Pair c;
    algorithm
      c := Pair(a.re - b.re, a.im - b.im);
    end subtract;
  end '-';
  encapsulated operator function '*'
    import Pair;
    input Pair a;
    input Pair b;
    output Pair c;
  algorithm
    c := Pair(a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re);
  end '*';
end Pair;
model M
  constant Pair j = Pair(0, 1);
  Pair z(re(start = 1, fixed = true), im(start = 0, fixed = true));
  Pair w = j * z, u, s = 2 * z + (-z), t = if time > 0.5 then z else Pair(0);
  Pair many[2] = {z, j} + {Pair(1, 1), z}, all = sum(many), power = product({z, z, z}), table[2, 2] = {many, many};
  Pair twice = sum(table), count = sum(Pair(k, 1) for k in 1:3);
equation
  der(z.re) = w.re;
  der(z.im) = w.im;
  u = z * z - 1;
end M;
"""


SUMS = ("all.re", "all.im", "power.re", "power.im", "twice.im", "count.re", "count.im")


def test_operators_of_a_record_are_its_functions(tmp_path):
    (tmp_path / "pair.mo").write_text(TEXT)
    turn = simulate(load_modelica(tmp_path / "pair.mo")["M"](), stop=1.0)
    found = {
        name: turn.final(name)
        for name in ("z.re", "z.im", "w.re", "u.re", "s.im", "t.re", "many[2].im", *SUMS)
    }
    c, s = np.cos(1), np.sin(1)  # z = exp(j t)
    assert found == pytest.approx(
        {
            "z.re": c,
            "z.im": s,
            "w.re": -s,
            "u.re": c * c - s * s - 1,
            "s.im": s,
            "t.re": c,
            "many[2].im": 1 + s,
            **dict(zip(SUMS, (1 + 2 * c, 2 + 2 * s, np.cos(3), np.sin(3), 4 + 4 * s, 6, 3), strict=True)),
        }
    )


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("z / z", "found operands of '/' that Pair has no function for"),
        ("{z, z} * {z, z}", "found operands of '\\*' that Pair has no function for"),
    ],
)
def test_operators_that_a_record_lacks_are_told(tmp_path, value, said):
    (tmp_path / "pair.mo").write_text(TEXT.replace("j * z, u", f"{value}, u"))
    with pytest.raises(ModelError, match=said):
        simulate(load_modelica(tmp_path / "pair.mo")["M"](), stop=1.0)


ARRAYS = """
record Pair
  Real a;
  Real b;
end Pair;
connector Pin
  Pair v;
  flow Pair i;
end Pin;
model Part
  Pin p, n;
  parameter Real R = 1;
equation
  {p.v.a, p.v.b} - {n.v.a, n.v.b} = R * {p.i.a, p.i.b};
  n.i = Pair(-p.i.a, -p.i.b);
end Part;
model Source
  Pin p;
  parameter Pair V = Pair(0, 0);
equation
  p.v = V;
end Source;
function both
  input Pair u[:];
  output Pair y[size(u, 1)];
algorithm
  for k in 1:size(u, 1) loop
    y[k].a := u[k].b;
    y[k].b := u[k].a;
  end for;
end both;
model M
  Source source(V = Pair(3, 6)), ground;
  Part one, two(R = 2);
  Pair many[2] = both({Pair(time, 2), Pair(3, 4)}), same[2] = fill(Pair(5, 6), 2), held, sum;
  Real x[2];
equation
  connect(source.p, one.p);
  connect(one.n, two.p);
  connect(two.n, ground.p);
algorithm
  x[1] := time;
  x[2] := 2 * x[1];
  sum := Pair(0, 0);
  for k in 1:2 loop
    sum.a := sum.a + many[k].a;
    sum.b := sum.b + same[k].b;
  end for;
algorithm
  when time > 0.5 then
    held := Pair(time, 2);
  end when;
end M;
"""


def test_records_in_connectors_functions_algorithms_and_whens(tmp_path):
    (tmp_path / "arrays.mo").write_text(ARRAYS)
    result = simulate(load_modelica(tmp_path / "arrays.mo")["M"](), stop=1.0)
    found = {
        n: result.final(n)
        for n in ("two.p.i.b", "many[1].b", "many[2].a", "x[2]", "sum.a", "sum.b", "held.a")
    }
    assert found == pytest.approx(
        {"two.p.i.b": 2, "many[1].b": 1, "many[2].a": 4, "x[2]": 2, "sum.a": 6, "sum.b": 12, "held.a": 0.5}
    )


@pytest.mark.parametrize(
    ("equation", "said"),
    [
        (
            "held = time",
            "line 40, column 3: found a record of a, b and no record beside '=', expected two of one type",
        ),
        ("same = {Pair(1, 2)}", r"found sizes \[2\] and \[1\] beside '=', expected one size"),
    ],
)
def test_records_equal_records_of_their_type_and_size_alone(tmp_path, equation, said):
    (tmp_path / "arrays.mo").write_text(ARRAYS.replace("connect(two.n, ground.p);", f"{equation};"))
    with pytest.raises(ModelError, match=said):
        simulate(load_modelica(tmp_path / "arrays.mo")["M"](), stop=1.0)
