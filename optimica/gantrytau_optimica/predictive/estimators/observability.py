"""Directions of the state without influence on any sample, unless they decay by themselves."""

import numpy as np

from gantrytau import ModelError
from gantrytau_optimica.fitting.rank import dependencies, indistinguishable
from gantrytau_optimica.predictive.estimators.observed_model import ObservedModel

NULL = 1e-9  # of the largest singular value of normed columns
NOTHING = 1e-13  # of the largest column
STAYS = 1.0 - 1e-9  # growth over the samples from which a direction does not decay
APART = 0.1  # of the sizes: how far the motion that is looked at lies from the start


def refuse_undetectable(observed: ObservedModel) -> None:
    """ModelError that names states, parameters and disturbances that the samples cannot determine.

    The model is linearised along a motion with arbitrary inputs from near the start: what is not seen there is not seen
    from anywhere (Pannocchia, Rawlings, 2003: the rank that lets disturbances be estimated, among others).
    """
    wanted = np.flatnonzero((observed.p > 0.0) | (observed.q > 0.0))
    rows, moved = _along(observed, APART)
    if rows is None or moved is None:
        rows, moved = _along(observed, 0.0)
    if rows is None or moved is None:
        return
    rows, moved = rows[:, wanted], moved[np.ix_(wanted, wanted)]
    norms = np.linalg.norm(rows, axis=0)
    norms = np.where(norms > NOTHING * norms.max(initial=0.0), norms, 0.0)
    normed = np.where(norms > 0.0, rows / np.where(norms > 0.0, norms, 1.0), 0.0)
    _, singular, right = np.linalg.svd(normed)
    rank = int(np.sum(singular > NULL * max(float(singular[0]), 1e-300))) if singular.size else 0
    scale = 1.0 / np.where(norms > 0.0, norms, norms.max(initial=0.0) or 1.0)
    null = right[rank:].T * scale[:, None]
    if not null.shape[1]:
        return
    growth, vectors = np.linalg.eig(np.linalg.lstsq(null, moved @ null, rcond=None)[0])
    staying = null @ vectors[:, np.abs(growth) >= STAYS]
    parts = np.hstack([staying.real, staying.imag]) / scale[:, None]
    if not parts.size:
        return
    left, sizes, _ = np.linalg.svd(parts, full_matrices=False)
    directions = left[:, sizes > 1e-6 * sizes[0]].T
    names = [observed.names[k] for k in wanted]
    told = [
        indistinguishable(sorted([one, *others], key=names.index))
        for one, others in dependencies(directions, scale, names).items()
    ]
    words = (
        f"{'; '.join(told)}, whose samples are {', '.join(observed.outputs)}; measure more, or estimate less"
    )
    raise ModelError(words, place=observed.place)


def _along(observed: ObservedModel, apart: float) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Samples by the first state (rows, nx), and the last state by it, (nx, nx); None where there is no motion."""
    stages, random = observed.stages, np.random.default_rng(0)
    count = max(10, 2 * stages.nx)
    x = np.clip(observed.x0 + apart * random.uniform(-1.0, 1.0, stages.nx), *observed.bounds)
    low, high = np.maximum(stages.lower_u, -1.0), np.minimum(stages.upper_u, 1.0)
    z, u, t = observed.z0, np.clip(np.zeros(stages.nu), low, high), 0.0
    rows, moved = [], np.eye(stages.nx)
    try:
        for k in range(count):
            z = observed.shown.settled(x, z, u, t)
            C = observed.shown.at(x[None], z[None], u[None], np.array([t]))[1][0]
            rows.append(C / observed.r[:, None] @ moved)
            u = low + random.uniform(0.0, 1.0, stages.nu) * (high - low) if apart else u
            w = stages.moved(x, np.tile(np.append(x, z), 2), u, t)
            moved = stages.linear(x[None], w[None], u[None], np.array([t])).A[0] @ moved
            x, t = w[stages.last], (k + 1) * stages.step
    except (ModelError, np.linalg.LinAlgError):
        return None, None
    found = np.vstack(rows)
    return (found, moved) if np.isfinite(found).all() and np.isfinite(moved).all() else (None, None)
