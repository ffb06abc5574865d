"""Conditions that depend on each other, named: found by the rank of their derivatives on a coarse mesh.

The equations of the model come first, then the conditions of the user as they are written. Row by row, what lies in the
span of the rows before it says nothing new, or cannot be: it follows from them or contradicts them.
"""

import casadi as ca
import numpy as np

from gantrytau import ModelError
from gantrytau_optimica.failures.constraint_labels import MEANING
from gantrytau_optimica.transcription.mesh import Mesh
from gantrytau_optimica.transcription.program import Program, first_guess
from gantrytau_optimica.transcription.transcribe import transcribed_again

COARSE = 4  # elements on which dependence is looked for; it does not change with their number
MOST = 3000  # unknowns up to which dense matrices are quick
RANK = 1e-9  # of its length: what remains of a row that depends on others
USER = ("boundary", "path", "step")


def dependent_conditions(program: Program) -> list[str]:
    """Conditions of the user that follow from others or contradict them near the first guess: each, and what decides it."""
    if any(layout.mesh.moving for layout in program.places.layouts):
        return []
    meshes = [Mesh(np.linspace(0.0, 1.0, min(COARSE, mesh.elements) + 1)) for mesh in program.meshes]
    coarse = transcribed_again(program, meshes=meshes)
    if coarse.places.size > MOST:
        return []
    x = _beside(first_guess(coarse) / coarse.places.scale)
    jacobian = coarse.assembled.jac_g(x, ca.DM(0, 1))[1]
    equal = coarse.lbg == coarse.ubg
    free = np.flatnonzero(coarse.lbw != coarse.ubw)
    model = [g.rows for g in coarse.groups if g.kind not in USER]
    user = [(g, g.rows[equal[g.rows]]) for g in coarse.groups if g.kind in USER]
    rows = np.concatenate([np.zeros(0, int), *(r[equal[r]] for r in model), *(r for _, r in user)])
    names = {int(r): MEANING[g.kind].format(g.name) for g, mine in user for r in mine}
    matrix = np.array(ca.DM(jacobian))[rows][:, free]
    if not np.all(np.isfinite(matrix)):
        return []
    held = [
        signal.name
        for layout in coarse.places.layouts
        for k, signal in enumerate(layout.phase.signals)
        if np.all((coarse.lbw == coarse.ubw)[layout.of(k)])
    ]
    alone = f"the model with {' and '.join(held)} held by its limits" if held else "the model alone"
    return _repeated(matrix, [names.get(int(r)) for r in rows], alone)


def check_freedom(program: Program) -> None:
    """ModelError if nothing is free, or if there are more conditions than unknowns."""
    name = program.problem.name
    equalities = int(np.sum(program.lbg == program.ubg))
    unknowns = program.places.size - int(np.sum(program.lbw == program.ubw))
    if unknowns == 0:
        raise ModelError(f"{name}: nothing is free; declare a Free number or an Input")
    if equalities > unknowns:
        found = dependent_conditions(program)
        more = f", and {len(found) - 4} more" if len(found) > 4 else ""
        raise ModelError(
            f"{name}: {equalities} conditions for {unknowns} unknowns on this mesh, expected no more conditions than "
            "unknowns; remove some at the ends or along the path, or free a number"
            + (f"; {', '.join(found[:4])}{more}" if found else "")
        )


def _beside(x: np.ndarray) -> np.ndarray:
    """Unknowns near x at which nothing vanishes by accident, as slopes of squares do at zero."""
    return x + 1e-3 * np.sin(1.0 + 7.3 * np.arange(x.size))


def _repeated(matrix: np.ndarray, names: list[str | None], alone: str) -> list[str]:
    """Named rows that lie in the span of those before them, and what they repeat."""
    size = np.linalg.norm(matrix, axis=1)
    size = np.where(size > 0, size, 1.0)
    matrix = matrix / size[:, None]
    kept: list[int] = []
    basis = np.zeros((matrix.shape[1], min(matrix.shape)))
    found: dict[str, str] = {}
    for k, name in enumerate(names):
        rest = matrix[k].copy()
        for _ in range(2):  # twice is enough against rounding (Kahan)
            rest -= basis[:, : len(kept)] @ (basis[:, : len(kept)].T @ rest)
        length = np.linalg.norm(rest)
        if length > RANK and len(kept) < basis.shape[1]:
            basis[:, len(kept)] = rest / length
            kept.append(k)
            continue
        if name is None or name in found:
            continue
        weights = np.linalg.lstsq(matrix[kept].T, matrix[k], rcond=None)[0]
        others = dict.fromkeys(
            other for w, j in zip(weights, kept, strict=True) if abs(w) > 1e-6 and (other := names[j])
        )
        others.pop(name, None)
        source = " and ".join(list(others)[:4]) or alone
        found[name] = f"{name} is decided already by {source}"
    return list(found.values())
