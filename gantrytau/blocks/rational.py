"""What transfer functions in s and in z have in common: two polynomials."""

from collections.abc import Iterator
from typing import Any

from gantrytau import Parameter, Real, require
from gantrytau.blocks.block import Block
from gantrytau.border.refusal import ModelError


class Rational(Block):
    """Base of transfer functions: numerator over denominator, both in falling powers; the state x, (n,), begins at zero."""

    numerator = Parameter(description="coefficients of the numerator, falling powers, a list")
    denominator = Parameter(description="coefficients of the denominator, falling powers, a list")
    x = Real(lambda self: max(1, self.denominator.shape[0] - 1), description="state", start=0.0, fixed=True)

    def coefficients(self) -> tuple[list[Any], list[Any]]:
        """Of numerator and denominator, (n + 1,) each. Raises ModelError if n is zero, or the numerator's degree larger."""
        b, a = self.numerator.elements(), self.denominator.elements()
        if len(a) == 1:
            raise ModelError("found a denominator of degree 0, expected at least 1; a Gain needs no state")
        if len(b) > len(a):
            raise ModelError(
                f"found a numerator of degree {len(b) - 1} over a denominator of degree {len(a) - 1}, expected at most the "
                "same: its output would need the input of later; leave out zeros in front, or put a filter in series"
            )
        return [0.0] * (len(a) - len(b)) + b, a

    def equations(self) -> Iterator[Any]:
        yield require(self.denominator[0] != 0, "expected a denominator that does not begin with zero")
