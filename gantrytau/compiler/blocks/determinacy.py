"""Refuses models whose equations have the right number and form, but do not determine their unknowns in numbers.

A body without mass, a rotation that no torque depends on: the coefficient is there, and it is zero.
"""

from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np

from gantrytau.border.refusal import StructureError
from gantrytau.compiler.aliases import Reduced
from gantrytau.compiler.blocks.solution import Block
from gantrytau.compiler.index_reduction import Indexed
from gantrytau.compiler.refusals import undetermined
from gantrytau.compiler.start.balance import balance
from gantrytau.compiler.start.start_values import StartValues
from gantrytau.compiler.symbol_spaces import values_at
from gantrytau.flattening.flat_model import FlatModel
from gantrytau.language.term_sizes import term_sizes

NOISE = 1e-12  # of a coefficient relative to the terms that it adds up: below, it is zero but for rounding
DOUBTFUL = 1e-6  # of the largest coefficient: smaller ones are looked at
LEAST = 1e-12  # singular value of the coefficients, rows and columns scaled, relative to the largest
ROUNDS = 4  # of scaling rows and columns


def refuse_undetermined(
    blocks: Sequence[Block],
    indexed: Indexed,
    reduced: Reduced,
    asked: StartValues,
    sample: Mapping[str, float],
    flat: FlatModel,
) -> None:
    """StructureError that names the unknowns which the equations leave free at the start, and why.

    asked: start values before they were consistent; sample: afterwards.
    """
    watched = [(b, b.slopes) for b in blocks if b.slopes is not None]
    if not watched:
        return
    entries = [e for _, slopes in watched for e in slopes.nonzeros()]
    values = values_at(ca.vertcat(*entries), sample).ravel()
    small = np.flatnonzero((values != 0) & (np.abs(values) <= DOUBTFUL * np.abs(values).max(initial=1.0)))
    if small.size:
        sizes = term_sizes([entries[k] for k in small], _found_sizes(reduced, asked, sample, flat))
        noise = NOISE * values_at(ca.vertcat(*sizes), sample).ravel()
        values[small[np.abs(values[small]) <= noise]] = 0.0
    begin = 0
    for block, symbolic in watched:
        matrix = np.zeros(symbolic.shape)
        matrix[tuple(symbolic.sparsity().get_triplet())] = values[begin : begin + symbolic.nnz()]
        begin += symbolic.nnz()
        free = _free(block, matrix)
        if free:
            names = [indexed.names[i] for i, _ in block.equations]
            raise undetermined(flat, reduced, free, names)


def _found_sizes(
    reduced: Reduced, asked: StartValues, sample: Mapping[str, float], flat: FlatModel
) -> dict[str, float]:
    """How large symbols count that were found from equations: what is left of their terms may be rounding."""
    found = {n: 1.0 for n, v in sample.items() if n not in reduced.table.values and asked.values.get(n) != v}
    for variable in flat.variables:
        for name, nominal in zip(variable.elements, variable.nominal or (), strict=False):
            alias = reduced.aliases[name]
            if alias.root is not None and alias.symbol in found:
                found[alias.symbol] = abs(reduced.table.number(nominal) / alias.factor)
    return found


def _free(block: Block, matrix: np.ndarray) -> list[str]:
    """Unknowns that a matrix leaves free."""
    if not np.all(np.isfinite(matrix)):
        return []
    if matrix.size == 1:
        return [] if matrix[0, 0] else [block.tears[0].name()]
    rows, columns = balance(matrix, 1)  # units and sizes of bodies count for nothing
    matrix = rows * matrix * columns
    for _ in range(ROUNDS):
        matrix = matrix / np.maximum(np.sqrt(np.abs(matrix).max(axis=1, keepdims=True)), 1e-150)
        matrix = matrix / np.maximum(np.sqrt(np.abs(matrix).max(axis=0, keepdims=True)), 1e-150)
    _, values, right = np.linalg.svd(matrix)
    if values[-1] > LEAST * values[0]:
        return []
    shares = np.abs(right[-1])
    return [block.tears[k].name() for k in np.argsort(-shares) if shares[k] > 0.1 * shares.max()]


def massless(indexed: Indexed, reduced: Reduced, flat: FlatModel) -> StructureError | None:
    """What a failed start may come from: a motion without inertia, such as that of a bar about itself.

    Nothing accelerates its coordinate, so it would have to follow from a balance of forces.
    """
    flows = {n for v in flat.variables if v.kind == "flow" for n in v.elements}
    roots = {reduced.aliases[n].root for n in flows}
    for i, residual in enumerate(reduced.residuals):
        names = [leaf.name() for leaf in ca.symvar(residual)]
        slow = [n for n in names if indexed.orders.get(n) == 1 and n in flat.hints]
        if slow and any(n in roots for n in names):
            words = ", ".join(f"{n} ({flat.hints[n]})" for n in slow[:4])
            return StructureError(
                f"{flat.name}: {words} would have to follow from a balance of forces, {indexed.names[i]}, because this "
                "motion has neither mass nor inertia. Expected a mass or an inertia for every motion: put a Body there, or "
                "hold the motion"
            )
    return None
