"""What corrections do to an estimate, by a run: a binary sequence in, a linear model out."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gantrytau import ModelError, prbs
from gantrytau_optimica.identification.rigid.robot_dynamics import IdentificationError
from gantrytau_optimica.identification.systems.identify_system import IdentifiedSystem, identify_system
from gantrytau_optimica.learning.estimators.estimator import Estimator
from gantrytau_optimica.learning.laws.lifted import pulses, toeplitz_blocks
from gantrytau_optimica.learning.runs.corrections import Corrections
from gantrytau_optimica.learning.runs.reference import Reference
from gantrytau_optimica.learning.runs.robot_runs import Plant

SAMPLES = 6000  # of the experiment
HELD = 5  # samples, for which the sequence keeps its value
REGISTER = 10  # bits: a period of 1023 values
REST = 100  # samples before, by which sensors are set to zero
LAGS = 40  # samples, within which an answer begins
SURE = 6.0  # deviations, from which it has begun
ORDERS = (6, 8, 10, 12, 14)  # that are tried
FAIR = 50.0  # % of what is measured, that a response must foretell


@dataclass(frozen=True, eq=False)
class EstimatedResponse:
    """From corrections (N, m) to what is learnt from, F_u + F_y T_uy of Dressler (2012), (7.15).

    system: identified, from corrections to all that the estimator reads, `delay` samples early; widths: columns of each
    letter that it reads; picked: columns of the estimate that are learnt; fit: of the half that did not identify it, in %.
    """

    system: IdentifiedSystem
    delay: int
    estimator: Estimator
    widths: dict[str, int]
    picked: tuple[int, ...]
    fit: np.ndarray

    @property
    def period(self) -> float:
        """The sampling period in s."""
        return float(self.system.period or 0.0)

    @property
    def axes(self) -> int:
        """How many corrections there are."""
        return len(self.picked)

    def lifted(self, samples: int) -> np.ndarray:
        """T (m N, m N), axis by axis."""
        h = np.zeros((samples, len(self.system.outputs), self.axes))
        h[self.delay :] = pulses(self.system, samples - self.delay)
        columns = toeplitz_blocks(h).reshape(h.shape[1], samples, -1).transpose(1, 0, 2)
        return self._estimated(columns).transpose(1, 0, 2).reshape(self.axes * samples, -1)

    def response(self, hz: np.ndarray, samples: int = 1250) -> np.ndarray:
        """Frequency response (K, m, m) at hz (K,): of a correction in the middle of a run, as estimators look ahead."""
        h = np.zeros((2 * samples, len(self.system.outputs), self.axes))
        h[samples + self.delay :] = pulses(self.system, samples - self.delay)
        found = self._estimated(h)
        t = self.period * np.arange(-samples, samples)
        return np.tensordot(np.exp(-2j * np.pi * np.outer(hz, t)), found, axes=1)

    def _estimated(self, answers: np.ndarray) -> np.ndarray:
        """What the estimator makes of answers (N, p, K) of all that it reads, (N, m, K)."""
        edges = np.cumsum(list(self.widths.values()))[:-1]
        signals = dict(zip(self.widths, np.split(answers, edges, axis=1), strict=True))
        return self.estimator.combine(signals, self.period)[:, list(self.picked)]


def estimated_response(
    plant: Plant,
    reference: Reference,
    estimator: Estimator,
    *,
    amplitude: float = 1e-3,
    order: int | None = None,
    seed: int = 0,
) -> EstimatedResponse:
    """Excite a plant at rest with pseudo-random binary corrections, and identify what an estimator sees of them.

    reference: where it begins, and the axes of the tool in which it moves, which are corrected; amplitude: m. Half of the
    samples identifies a system of this order, or of the one of several that foretells the other half best. Raises
    ModelError where the estimate does not follow the corrections.
    """
    corrections = Corrections(plant.kinematics, estimator.joints, reference.moving)
    held = HELD * plant.period
    shift = (2**REGISTER - 1) // corrections.count
    u = np.column_stack(
        [
            prbs(REGISTER, held, amplitude, seed=5 + k * shift)
            .values(plant.period * np.arange(SAMPLES))
            .ravel()
            for k in range(corrections.count)
        ]
    )
    u = np.vstack([np.zeros((REST, u.shape[1])), u])
    r = np.tile(reference.r[0], (len(u), 1))
    run = plant.run(*corrections.references(r, u, plant.period), seed=seed)
    signals = estimator.signals(run, plant.kinematics)
    widths = {letter: x.shape[1] for letter, x in signals.items()}
    y = np.hstack(list(signals.values()))
    u, y = u[REST:], y[REST:]
    delay = dead_time(u, y)
    u, y = u[: len(u) - delay], y[delay:]
    system, fit = _foretelling(u, y, (order,) if order else ORDERS, plant.period)
    return EstimatedResponse(system, delay, estimator, widths, corrections.picked, fit)


def _foretelling(
    u: np.ndarray, y: np.ndarray, orders: Sequence[int], period: float
) -> tuple[IdentifiedSystem, np.ndarray]:
    """The system by the first half that foretells the second best, and how well, (p,) in %."""
    half = len(u) // 2
    best: tuple[float, IdentifiedSystem, np.ndarray] | None = None
    words = ""
    for order in orders:
        try:
            system = identify_system(u[:half], y[:half], order=order, period=period)
        except IdentificationError as error:
            words = f"; {error}"
            continue
        fit = system.fit(u[half:], y[half:])
        if best is None or fit.min() > best[0]:
            best = float(fit.min()), system, fit
    if best is None or best[0] < FAIR:
        found = f"{best[0]:.0f} % of what is measured foretold" if best else "no system that comes to rest"
        raise ModelError(
            f"estimated_response: found {found}, expected {FAIR:.0f} % at least; take a larger amplitude, or name a "
            f"response{words}",
            argument="response",
        )
    return best[1], best[2]


def dead_time(u: np.ndarray, y: np.ndarray) -> int:
    """Samples after which outputs y (N, p) begin to answer to inputs u (N, m), by least squares of short pulse responses."""
    lagged = np.hstack([np.roll(u, k, axis=0) for k in range(LAGS)])[LAGS:]
    wanted = y[LAGS:] - y[LAGS:].mean(axis=0)
    lagged = lagged - lagged.mean(axis=0)
    found, *_ = np.linalg.lstsq(lagged, wanted, rcond=None)
    left = wanted - lagged @ found
    inverse = np.diag(np.linalg.inv(lagged.T @ lagged))
    deviation = np.sqrt(inverse[:, None] * (left**2).mean(axis=0))
    sure = (np.abs(found) > SURE * deviation).reshape(LAGS, u.shape[1], -1).any(axis=(1, 2))
    begun = np.flatnonzero(sure)
    if not begun.size:
        raise ModelError(
            f"estimated_response: found nothing in what is measured that follows corrections within {LAGS} samples; take a "
            "larger amplitude, or look at the sensors"
        )
    return int(begun[0])
