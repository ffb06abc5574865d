"""Variables that others give outright, with all their derivatives: the places of a rigid body's points.

An equation such as b.r == a.r + R p gives b.r whatever the pose. Such variables need not be integrated.
"""

from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np

from gantrytau.compiler.blocks.tearing import entry_sizes, moving, switching_places, tear
from gantrytau.compiler.index_reduction import Key
from gantrytau.compiler.symbol_spaces import values_at
from gantrytau.compiler.translated import Translated
from gantrytau.language.piecewise import switched
from gantrytau.language.symbols import derivative_name, split_derivative


def dependents(dae: Translated) -> list[tuple[int, str]]:
    """Equations and the variables they give, in order of solution; the coefficient is never zero."""
    indexed, chains = dae.indexed, dae.reduced.chains
    rows = [i for i, count in enumerate(indexed.counts) if count]
    columns = [n for n, top in indexed.orders.items() if top]
    if not rows:
        return []
    f = ca.vertcat(*(indexed.residuals[i, indexed.counts[i]] for i in rows))
    x = ca.vertcat(*(chains.sx(n, indexed.orders[n]) for n in columns))
    jacobian = ca.jacobian(f, x)
    numbers = values_at(jacobian, dae.start)
    # only an equation that is differentiated as often as the variable gives it as it is
    positions = ca.vertcat(*(chains.sx(n) for n in columns))
    smooth = switched([ca.vertcat(*(indexed.residuals[i, 0] for i in rows))], set(columns))
    slopes = ca.jacobian(smooth.expressions[0], positions)
    steady = {
        (i, j) for i, j, e in entries(slopes) if all(s.name() in dae.table.values for s in ca.symvar(e))
    } - switching_places(smooth, positions)
    whole = np.array(
        [
            [indexed.counts[i] == indexed.orders[n] and (a, b) in steady for b, n in enumerate(columns)]
            for a, i in enumerate(rows)
        ]
    )
    states = {split_derivative(n)[0] for n in dae.choice.states}
    torn = tear(
        jacobian,
        entry_sizes(jacobian, np.where(whole, numbers, 0.0)[*jacobian.sparsity().get_triplet()][None]),
        x,
        relaxed=True,
        partner={},
        first={j for j, n in enumerate(columns) if n in states},
        barred=moving(jacobian, dae.table.values),
    )
    return [(rows[i], columns[j]) for i, j in torn.assignments]


def entries(matrix: ca.SX) -> list[tuple[int, int, ca.SX]]:
    """Row, column and expression of the entries that are not structurally zero."""
    return list(zip(*matrix.sparsity().get_triplet(), matrix.nonzeros(), strict=True))


def definitions_of(
    dae: Translated, pairs: Sequence[tuple[int, str]], residuals: Mapping[Key, ca.SX]
) -> list[tuple[ca.SX, ca.SX]]:
    """(symbol, expression) of dependent variables and their derivatives below the highest, in order."""
    indexed, chains = dae.indexed, dae.reduced.chains
    found: list[tuple[ca.SX, ca.SX]] = []
    for stage in range(-max(indexed.orders.values(), default=0), 0):
        for i, name in pairs:
            order = stage + indexed.orders[name]
            if order < 0:
                continue
            residual, symbol = residuals[i, order], chains.named(derivative_name(name, order))
            slope = ca.jacobian(residual, symbol)
            found.append((symbol, -ca.substitute(residual, symbol, 0) / slope))
    return found
