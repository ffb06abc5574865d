"""The arrays of an FMU: vectors of symbols, and their numbers where the model starts."""

from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np

from gantrytau import Dae


def column(parts: Sequence[ca.SX]) -> ca.SX:
    """Vectors below each other; no vectors give an empty one."""
    parts = [p for p in parts if p.numel()]
    return ca.SX(ca.vertcat(*parts)) if parts else ca.SX(0, 1)


def numbers_of(dae: Dae, arrays: Mapping[str, ca.SX]) -> dict[str, np.ndarray]:
    """Values of all arrays where the model starts, frictions locked."""
    values = {**dae.start, **dae.table.values, dae.flat.time.name(): dae.start.get(dae.flat.time.name(), 0.0)}
    return {n: np.array([values.get(s.name(), 0.0) for s in a.elements()]) for n, a in arrays.items()}
