"""Arrays of components with two dimensions: names, modifications by element, slices, connections."""

from gantrytau import load_modelica, simulate

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
