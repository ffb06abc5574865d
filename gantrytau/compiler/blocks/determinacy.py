"""Refuses models whose equations have the right number and form, but do not determine their unknowns in numbers.

A body without mass, a rotation that no torque depends on: the coefficient is there, and it is zero.
"""

from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np

from gantrytau.compiler.aliases import Reduced
from gantrytau.compiler.alphabets import values_at
from gantrytau.compiler.blocks.solution import Block
from gantrytau.compiler.index_reduction import Indexed
from gantrytau.compiler.refusals import undetermined, without_inertia
from gantrytau.errors import StructureError
from gantrytau.flattening.flat_model import FlatModel

LEAST = 1e-12  # of a coefficient, or of a singular value, relative to the terms of its equation


def refuse_undetermined(
    blocks: Sequence[Block], indexed: Indexed, reduced: Reduced, sample: Mapping[str, float], flat: FlatModel
) -> None:
    """StructureError that names the unknowns which the equations leave free at the start, and why."""
    watched = [b for b in blocks if b.tears and b.kind in ("explicit", "linear")]
    if not watched:
        return
    residual = ca.vertcat(*(r for b in watched for r in b.residuals))
    leaves = ca.symvar(residual)
    jacobian = ca.jacobian(residual, ca.vertcat(*leaves))
    entries = values_at(ca.vertcat(*jacobian.nonzeros()), sample).ravel()
    rows, columns = (np.array(x, dtype=int) for x in jacobian.sparsity().get_triplet())
    largest = np.zeros(residual.numel())
    np.maximum.at(largest, rows, np.nan_to_num(np.abs(entries)))
    place = {leaf.name(): j for j, leaf in enumerate(leaves)}
    begin = 0
    for block in watched:
        count = len(block.tears)
        own = {place[y.name()]: k for k, y in enumerate(block.tears) if y.name() in place}
        matrix = np.zeros((count, count))
        for k in np.flatnonzero((rows >= begin) & (rows < begin + count)):
            if columns[k] in own:
                matrix[rows[k] - begin, own[columns[k]]] = entries[k]
        free = _free(block, matrix, largest[begin : begin + count, None])
        begin += count
        if free:
            names = [indexed.names[i] for i, _ in block.equations]
            raise undetermined(flat, reduced, free, names)


def _free(block: Block, matrix: np.ndarray, terms: np.ndarray) -> list[str]:
    """Unknowns that a matrix leaves free; terms: the largest coefficient in each equation."""
    if not np.all(np.isfinite(matrix)):
        return []
    _, values, right = np.linalg.svd(matrix / np.maximum(terms, 1e-300))
    if values[-1] > LEAST * max(values[0], 1e-3):
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
            return without_inertia(flat, slow, indexed.names[i])
    return None
