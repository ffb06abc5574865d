"""What blocks of the Modelica library are written with: pulses, choices by index, numbers that functions loop over."""

import numpy as np
import pytest

from gantrytau import ModelError, SolveError, linearize, load_modelica, simulate


@pytest.fixture
def ran(tmp_path):
    def run(text, stop=2.0, **parameters):
        (tmp_path / "m.mo").write_text(text)
        return simulate(load_modelica(tmp_path / "m.mo")["M"](**parameters), stop=stop)

    return run


PULSES = """model M
  Boolean b, c(start=false), d = sample(0, 0.3);
  Integer n(start=0), m(start=0), k(start=0);
  discrete Real last(start=-1, fixed=true);
equation
  b = sample(0.25, 0.5);
  c = b;
  when b then
    n = pre(n) + 1;
    last = time;
  end when;
  when d then
    k = pre(k) + 1;
  end when;
  when {c, initial()} then
    m = pre(m) + 1;
  end when;
end M;
"""


def test_a_boolean_that_is_a_sample_is_true_at_its_instants_only(ran):
    found = ran(PULSES)
    assert [found.final(name) for name in ("n", "m", "k", "last", "b", "d")] == [4, 5, 7, 1.75, 0, 0]


LATCHES = """model M
  Boolean u = time > 0.5 and time < 1;
  Integer n(start=1, fixed=true), m, k(start=1, fixed=true);
algorithm
  n := if u then 7 else pre(n);
  m := 2 * n;
algorithm
  if u then
    k := 5;
  elseif time >= 1.5 then
    k := pre(n);
  else
    k := pre(k);
  end if;
end M;
"""


def test_an_algorithm_outside_of_when_keeps_values_before(ran):
    found = ran(LATCHES)
    assert [[float(found.at(t, n)) for t in (0.4, 0.7, 1.2, 1.9)] for n in "nmk"] == [
        [1, 7, 7, 7],
        [2, 14, 14, 14],
        [1, 5, 5, 7],
    ]


CHOICES = """function first "index of the first true one, 0 without any, and the one behind it that is true"
  input Boolean b[:];
  output Integer index;
  output Integer skipped = 0;
algorithm
  index := 0;
  for i in 1:size(b, 1) loop
    if not b[i] then
      skipped := skipped + 1;
      if i == 2 then
        break;
      end if;
    else
      index := i;
      return;
    end if;
  end for;
  index := -1;
end first;
model M
  Boolean b[3] = {time > 1.5, time > 1, time > 0.5};
  Integer index, skipped;
  Real table[2, 3] = {{10, 20, 30}, {1, 2, 3}} * (1 + time), y;
equation
  (index, skipped) = first(b);
  y = if index < 1 then 0 else table[2, index];
end M;
"""


def test_functions_leave_loops_where_conditions_vary_and_arrays_are_indexed_by_what_varies(ran):
    found, at = ran(CHOICES), np.array([0.25, 0.75, 1.25, 1.75])
    np.testing.assert_array_equal(found.at(at, "index"), [-1, -1, 2, 1])
    np.testing.assert_array_equal(found.at(at, "skipped"), [2, 2, 1, 0])
    np.testing.assert_allclose(found.at(at, "y"), [0, 0, 2 * 2.25, 2.75], atol=1e-9)


NUMBERS = """function halvings "how often x can be halved above the least"
  input Real x, least;
  output Integer n = 0;
protected
  Real rest = x;
algorithm
  while rest > least loop
    rest := rest / 2;
    n := n + 1;
  end while;
end halvings;
function twice
  input Real x, least;
  output Integer n = 2 * halvings(x, least);
algorithm
end twice;
model M
  parameter Real A[:, size(A, 1)] = {{-1, 0}, {0, -k}}, k = 3;
  parameter Real least = 1;
  parameter Integer n = size(A, 1), count = twice(k, least);
  Real x[n](each start=1, each fixed=true), y;
equation
  der(x[1:n]) = A[1:n, :] * x + zeros(n);
  y = count + time;
end M;
"""


def test_numbers_that_a_function_loops_over_are_known_and_change_by_modification(ran):
    found = ran(NUMBERS, 1.0)
    np.testing.assert_allclose(
        found.final("x[2]"), np.exp(-3), rtol=1e-5
    )  # ten times the integrator's tolerance
    assert found.final("y") == pytest.approx(5)
    assert ran(NUMBERS, 1.0, least=0.1).final("y") == pytest.approx(11)


BRANCHES = """model M
  parameter Real most = 2;
  Boolean u = time > 0.5;
  Real y(start=0, fixed=true);
initial equation
  pre(u) = true;
equation
  if u then
    der(y) = 2;
    assert(y < most, "y is above its limit");
  else
    der(y) = 0;
    assert(y > -1, "y is below its limit");
  end if;
end M;
"""


def test_assertions_of_a_branch_hold_where_it_acts(ran):
    assert ran(BRANCHES, 1.0).final("y") == pytest.approx(1)
    with pytest.raises((ModelError, SolveError), match="above its limit"):
        ran(BRANCHES, 1.0, most=0.5)


def test_a_model_with_assertions_is_linearised(tmp_path):
    text = 'model M input Real u; output Real y(start=0); equation der(y) = u - 2*y; assert(y < 1, "far"); end M;'
    (tmp_path / "m.mo").write_text(text)
    assert linearize(load_modelica(tmp_path / "m.mo")["M"]()).poles == pytest.approx([-2])
