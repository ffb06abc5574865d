"""Arrays of components with two dimensions; classes that extend those of their names, and constants of packages."""

import numpy as np
import pytest

from gantrytau import ModelError, load_modelica, simulate

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
    (tmp_path / "grids.mo").write_text(GRID)
    library = load_modelica(tmp_path / "grids.mo")
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
    (tmp_path / "media.mo").write_text(EXTENDED)
    library = load_modelica(tmp_path / "media.mo")
    for package, k, doubled in (("Middle", 2, 0), ("Last", 3, 1)):
        result = simulate(library[f"Media.{package}.Use"](), stop=1.0)
        assert result.final("v") == pytest.approx(3 * np.exp(-k), rel=1e-6)
        y = np.exp(-k) + 10
        assert result.final("b.z" if doubled else "b.y") == pytest.approx((1 + doubled) * y, rel=1e-6)
    assert simulate(library["Media.Chosen"](), stop=1.0).final("twice") == 18
    with pytest.raises(ModelError, match="'Other' behind 'extends', expected an inherited class"):
        library["Media.Inherited"]
