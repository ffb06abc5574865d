"""From measured inputs and outputs to a linear model without physics."""

import os
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from gantrytau import ModelError, StateSpace
from gantrytau.border.checks import number, whole
from gantrytau.results.figures import check_suffix, finished
from gantrytau_optimica.fitting.diagnostics import Diagnostics, ResidualSeries, diagnose
from gantrytau_optimica.fitting.finding import Finding
from gantrytau_optimica.identification.rigid.robot_dynamics import IdentificationError
from gantrytau_optimica.identification.spectra.sampled_motion import sampled_motion
from gantrytau_optimica.identification.systems.linear_fit import followed
from gantrytau_optimica.identification.systems.other_systems import others_explain_more, system_of
from gantrytau_optimica.identification.systems.subspace import SharedSpace, shared_space

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHIFTED = 1.25  # times: rows that repeat each other, shifted, agree by chance as much more (1.2 in 60 trials)
GROWN = 1e6  # times, by which a free motion may grow over the samples
NONE = np.zeros(0, dtype=int)


class IdentifiedSystem(StateSpace):
    """A sampled linear system that was identified, about the means of its inputs and outputs.

    singular_values: canonical correlations of past and future, (k,) from 1 down, for orders up to k: an order ends at a
    gap; those of noise alone stay below `noise`. findings: kinds "order", "unstable", "drift",
    "outliers"; diagnostics: what is left of the outputs. It answers as any `StateSpace` does:
    poles, damping, `plot_bode`, a component of models.
    """

    def __init__(
        self,
        matrices: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
        period: float,
        singular_values: np.ndarray,
        noise: float,
        findings: tuple[Finding, ...],
        diagnostics: Diagnostics,
        **modifications: Any,
    ):
        super().__init__(*matrices, period=period, **modifications)
        self.singular_values = singular_values
        self.noise = noise
        self.findings = findings
        self.diagnostics = diagnostics

    @property
    def title(self) -> str:
        """The order and the period."""
        return f"system of order {len(self.A)}, every {self.period:g} s"

    def follow(self, u: ArrayLike, y: ArrayLike) -> np.ndarray:
        """Outputs (N, p) simulated with u (N, m), from the first state and about the constants that suit y (N, p) best."""
        u, y = sampled_motion(f"{self.title}.follow", u, y, least=len(self.A) + 2)
        for letter, values, count in (("u", u, len(self.inputs)), ("y", y, len(self.outputs))):
            if values.shape[1] != count:
                raise ModelError(
                    f"{self.title}: found {letter} of shape {values.shape}, expected (N, {count}), as it was "
                    "identified with",
                    argument=letter,
                )
        return followed((self.A, self.B, self.C, self.D), u, y)

    def fit(self, u: ArrayLike, y: ArrayLike) -> np.ndarray:
        """100 (1 - |y - simulated| / |y - mean|) of each output, (p,) in %: of other data than its own it is a validation.

        u (N, m), y (N, p). Raises ModelError for data of other numbers of inputs or outputs.
        """
        simulated = self.follow(u, y)
        y = np.asarray(y, dtype=float).reshape(simulated.shape)
        return 100 * (1 - np.linalg.norm(y - simulated, axis=0) / np.linalg.norm(y - y.mean(axis=0), axis=0))

    def plot_singular_values(self, *, file: str | os.PathLike[str] | None = None) -> "Figure":
        """Singular values over the order, and where those of noise end."""
        import matplotlib.pyplot as plt

        if file is not None:
            check_suffix(file)
        figure, axis = plt.subplots(figsize=(6.0, 3.2), layout="constrained")
        orders = np.arange(1, len(self.singular_values) + 1)
        chosen = orders <= len(self.A)
        axis.plot(orders[chosen], self.singular_values[chosen], "o", label=f"order {len(self.A)}")
        axis.plot(orders[~chosen], self.singular_values[~chosen], "o", mfc="none", color="C0")
        axis.axhline(self.noise, color="0.6", linestyle="--", label="noise alone stays below")
        axis.set(xlabel="order", ylabel="canonical correlation", ylim=(0, 1.05))
        axis.legend()
        return finished(figure, file)


def identify_system(
    u: ArrayLike, y: ArrayLike, *, order: int, period: float, block_rows: int = 25
) -> IdentifiedSystem:
    """A linear system x+ = A x + B u, y = C x + D u of an order, from samples every `period` s.

    u (N, m), y (N, p), or (N,) of one; their means do not count. By subspaces with weights of canonical correlations
    (CVA), B and D by least squares of the simulated outputs. block_rows: samples of past and of future that are held
    against each other; the order is below block_rows p. Look at `.singular_values` for the order, and at `.fit` on other
    data. Raises ModelError for samples that are too few or not finite and for orders that do not fit, IdentificationError
    for inputs that do not excite and for a system that runs away. Van Overschee and De Moor (1996);
    Dressler (2012), (6.12), (6.13).
    """
    whole("identify_system", "block_rows", block_rows, least=2)
    whole("identify_system", "order", order, least=1)
    period = number("identify_system", "period", period, unit="s", above=0)
    u, y = sampled_motion("identify_system", u, y, least=2)
    _check_sizes(u, y, order, block_rows)
    sizes = [np.linalg.norm(x - x.mean(axis=0), axis=0) / np.sqrt(len(x)) for x in (u, y)]
    normed_u, normed_y = ((x - x.mean(axis=0)) / size for x, size in zip((u, y), sizes, strict=True))
    space = shared_space(normed_u, normed_y, block_rows)
    _check_space(space, order, block_rows)
    A, B, C, D = best = system_of(space, order, normed_u, normed_y)
    radius = float(np.abs(np.linalg.eigvals(A)).max())
    if radius > 1 and len(u) * np.log(radius) > np.log(GROWN):
        raise IdentificationError(
            f"identify_system: found a pole with |z| = {radius:.6g}, whose motion would grow {len(u)} samples long, "
            "expected a system that comes to rest; take a lower order, more samples, or outputs that do not drift"
        )
    matrices = (A, B / sizes[0], C * sizes[1][:, None], D * sizes[1][:, None] / sizes[0])
    noise = _of_noise(len(u), u.shape[1], y.shape[1], block_rows)
    left = _diagnostics(y, followed(matrices, u, y), period)
    found = (
        *_findings(space, order, noise, radius),
        *others_explain_more(best, space, noise, normed_u, normed_y, block_rows),
        *(f for f in left.findings if f.kind != "not white"),  # noise of outputs may have any colour
    )
    return IdentifiedSystem(matrices, float(period), space.correlations, noise, found, left)


def _diagnostics(y: np.ndarray, simulated: np.ndarray, period: float) -> Diagnostics:
    """What is left of each output, simulated with its inputs."""
    time = {"time": period * np.arange(len(y))}
    columns = enumerate(zip(y.T, simulated.T, strict=True))
    return diagnose(
        [ResidualSeries(f"output {i}", a - b, measured=a - np.mean(a), signals=time) for i, (a, b) in columns]
    )


def _check_sizes(u: np.ndarray, y: np.ndarray, order: int, block_rows: int) -> None:
    m, p = u.shape[1], y.shape[1]
    if order > (block_rows - 1) * p:
        raise ModelError(
            f"identify_system: found order={order} with {p} outputs and block_rows={block_rows}, expected "
            f"{(block_rows - 1) * p} at most; take block_rows={-(-order // p) + 1} or more",
            argument="order",
        )
    least = 2 * block_rows * (m + p) + 2 * block_rows - 1
    if len(u) < least:
        raise ModelError(
            f"identify_system: found {len(u)} samples of {m} inputs and {p} outputs, expected {least} at least for "
            f"block_rows={block_rows}; measure for longer, or take fewer block_rows",
            argument="y",
        )


def _check_space(space: SharedSpace, order: int, block_rows: int) -> None:
    if space.excited < space.wanted:
        raise IdentificationError(
            f"identify_system: found inputs that excite {space.excited} of {space.wanted} directions, expected all: "
            "an input repeats another, or is made of few frequencies; take random binary sequences that are independent "
            f"(`prbs`), or fewer block_rows than {block_rows}"
        )
    if order > len(space.correlations):
        raise IdentificationError(
            f"identify_system: found data of order {len(space.correlations)} without noise, expected "
            f"{order} at least; take this order"
        )


def _of_noise(samples: int, inputs: int, outputs: int, rows: int) -> float:
    """The largest canonical correlation of independent noise in past and future: Wachter's limit for many rows."""
    past, future = ((count * rows) / (samples - inputs * rows) for count in (inputs + outputs, outputs))
    return float(min(1.0, SHIFTED * (np.sqrt(past * (1 - future)) + np.sqrt(future * (1 - past)))))


def _findings(space: SharedSpace, order: int, noise: float, radius: float) -> list[Finding]:
    found, told = [], int(np.sum(space.correlations > noise))
    if order > told:
        words = f"past and future share {told} directions more than noise would, of {order}: the rest of the order follows "
        found.append(Finding("order", NONE, f"{words}noise; take order={told}, or measure for longer"))
    if radius > 1:
        words = f"a pole with |z| = {radius:.6g} grows: a drift, or an order that is too high"
        found.append(Finding("unstable", NONE, words))
    return found
