"""On what the rates and outputs of an FMU depend."""

from collections.abc import Sequence

import casadi as ca
import numpy as np

from gantrytau_fmu.code.arrays import column
from gantrytau_fmu.code.formulas import Formulas


class Dependencies:
    """On what rates, outputs and samples depend, through the implicit blocks and the sampled variables.

    rates, outputs, samples (of Discretes, too): boolean rows over (time, states, inputs, parameters). What is delayed moves
    with time alone; delayed_rates, delayed_outputs: how much of it they look at.
    """

    def __init__(self, formulas: Formulas, wanted: Sequence[ca.SX]):
        arrays = formulas.arrays
        held, inputs = len(formulas.held) + len(formulas.discretes), len(formulas.inputs)
        past = len(formulas.delays)
        sizes = [1, arrays["x"].numel(), inputs + held + past, arrays["p"].numel()]
        z = np.zeros((arrays["z"].numel(), sum(sizes)), dtype=bool)
        place = 0
        for block in formulas.blocks:
            z[place : place + len(block.names)] = self._rows(formulas, block.residual, z).any(axis=0)
            place += len(block.names)
        late = slice(1 + sizes[1] + inputs + held, 1 + sizes[1] + inputs + held + past)
        own = slice(1 + sizes[1] + inputs, 1 + sizes[1] + inputs + held)
        samples = self._rows(formulas, column([formulas.samples, formulas.jump.discretes]), z)
        for _ in range(held):  # what is held may depend on what is held
            samples |= samples[:, own] @ samples
        known = np.eye(sum(sizes), dtype=bool)
        known[own] = samples
        shown = np.delete(np.arange(sum(sizes)), slice(own.start, late.stop))
        rates, outputs = (self._rows(formulas, e, z) @ known for e in (formulas.rates, column(wanted)))
        self.delayed_rates: list[int] = rates[:, late].sum(axis=1).tolist()
        self.delayed_outputs: list[int] = outputs[:, late].sum(axis=1).tolist()
        for rows in (rates, outputs, samples):
            rows[:, 0] |= rows[:, late].any(axis=1)
        self.rates, self.outputs, self.samples = rates[:, shown], outputs[:, shown], samples[:, shown]

    @staticmethod
    def _rows(formulas: Formulas, expression: ca.SX, z: np.ndarray) -> np.ndarray:
        """Dependence of a vector on (t, x, u, p), directly and through z."""
        arrays = formulas.arrays
        function = ca.Function("f", list(arrays.values()), [ca.densify(expression)])
        places = [list(arrays).index(n) for n in "txupz"]
        patterns = [np.array(ca.DM(function.jac_sparsity(0, k), 1).full(), dtype=bool) for k in places]
        *direct, through = [
            found.reshape(expression.numel(), arrays[n].numel())
            for n, found in zip("txupz", patterns, strict=True)
        ]
        return np.hstack(direct) | through @ z
