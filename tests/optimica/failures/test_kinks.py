"""Kinks are named where a solve gets stuck."""

import pytest

from gantrytau import SolveError, fabs, fmax
from gantrytau_optimica import final, optimize
from tests.optimica.problems import FastestMass


class LeastFuel(FastestMass):
    """1 m in 3 s with the least integral of |u|, and an end that costs a kink as well."""

    final_time = 3.0

    def objective(self):
        return fmax(final(self.mass.v), -final(self.mass.x))

    def integrand(self):
        return fabs(self.mass.u)


def test_kinks_are_named_where_they_stand():
    with pytest.raises(SolveError) as caught:
        optimize(LeastFuel, max_iterations=12)
    assert "Not smooth, so that derivatives jump:" in str(caught.value)
    assert "`fabs(mass.u)` in the integrand" in str(caught.value)
    assert "fmax(final(mass.v)" in str(caught.value)
    assert "Write fabs(x) as p + n with inputs p, n >= 0" in str(caught.value)
