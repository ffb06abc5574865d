"""The page of equations says what the model says: every formula is read back and computed at random numbers."""

import casadi as ca
import numpy as np
import pytest

from gantrytau import Dae, translate
from gantrytau.language.symbols import split_derivative
from gantrytau.mechanics.translational import LinearFriction
from gantrytau.writing.excerpt import excerpt
from gantrytau_models import FourBar, GantryTau, Pendulum, SixLinkGantryTau, prototypes
from tests.writing.page_reader import PageOfEquations
from tests.writing.test_readable import Named

AS_WRITTEN, SOLVED = "By component, as written", "In the order of solution"


class Numbers(dict[str, np.ndarray | float]):
    """Random numbers by name, made when asked for: of scalars, vectors, derivatives."""

    def __init__(self, dae: Dae):
        self.dae, self.generator = dae, np.random.default_rng(1)

    def __missing__(self, name: str):
        base, order = split_derivative(name)
        whole = self.dae.flat.vectors.get(base)
        if whole is not None and whole.shape:
            elements = [self["der(" * order + n + ")" * order] for n in whole.elements]
            return np.array(elements)
        assert base in self.dae.flat.scalars, name
        self[name] = float(self.generator.uniform(0.5, 2.0))
        return self[name]

    def of(self, *expressions: ca.SX) -> np.ndarray:
        """The values of expressions."""
        vector = ca.densify(ca.SX(ca.vertcat(*expressions)))
        leaves = ca.symvar(vector)
        function = ca.Function("f", [ca.vertcat(*leaves)], [vector])
        return np.array(function(ca.DM([self[leaf.name()] for leaf in leaves]))).ravel()


def close(found, expected) -> bool:
    """Within what rounding leaves of sums in another order, whose terms are up to a thousand, at 14 digits."""
    return np.allclose(found, expected, rtol=1e-9, atol=1e-10, equal_nan=True)


def assert_says_the_same(dae: Dae) -> PageOfEquations:
    page, numbers, found = PageOfEquations(dae.equations("html")), Numbers(dae), excerpt(dae)
    groups = [page.values(group, numbers) for group in page.parts[SOLVED]]
    blocks = groups[: len(found.sections)]
    assert len(blocks) == len(found.sections)
    for section, lines in zip(found.sections, blocks, strict=True):
        expected = numbers.of(*(line.right for line in section.lines))
        assert len(lines) == len(expected)
        for line, value, (formula, _, right) in zip(section.lines, expected, lines, strict=True):
            assert formula.left == ("0" if line.left is None else f"N[{line.left!r}]")
            assert close(right, value), (formula, right, value)
    written = [row for group in page.parts[AS_WRITTEN] for row in page.values(group, numbers)]
    residuals = np.concatenate([np.atleast_1d(left - right) for _, left, right in written] or [np.zeros(0)])
    expected = numbers.of(*(e.residual for e in found.equations)) if found.equations else np.zeros(0)
    assert close(np.sort(residuals), np.sort(expected))
    return page


MODELS = {
    "pendulum": Pendulum,
    "names": Named,
    "four bars": FourBar,
    "three links": lambda: GantryTau(prototypes.L1, friction=LinearFriction),
    "six links": lambda: SixLinkGantryTau(prototypes.D1),
}


@pytest.mark.parametrize("name", MODELS)
def test_all_formulas_have_the_values_of_the_model(name):
    assert_says_the_same(translate(MODELS[name](), units=name != "names"))
