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
  Pair many[2] = {z, j} + {Pair(1, 1), z};
equation
  der(z.re) = w.re;
  der(z.im) = w.im;
  u = z * z - 1;
end M;
"""


def test_operators_of_a_record_are_its_functions(tmp_path):
    (tmp_path / "pair.mo").write_text(TEXT)
    turn = simulate(load_modelica(tmp_path / "pair.mo")["M"](), stop=1.0)
    found = {
        name: turn.final(name) for name in ("z.re", "z.im", "w.re", "u.re", "s.im", "t.re", "many[2].im")
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
