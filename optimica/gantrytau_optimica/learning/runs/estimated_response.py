"""What corrections do to an estimate, by a run: a binary sequence in, a linear model out."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gantrytau import ModelError, Result, prbs
from gantrytau.border.checks import number, whole
from gantrytau.describing.record import Record
from gantrytau_optimica.identification.rigid.robot_dynamics import IdentificationError
from gantrytau_optimica.identification.systems.identify_system import IdentifiedSystem, identify_system
from gantrytau_optimica.learning.estimators.estimator import Estimator
from gantrytau_optimica.learning.estimators.estimators import Kinematic, Measured
from gantrytau_optimica.learning.laws.lifted import pulses, toeplitz_blocks
from gantrytau_optimica.learning.runs.corrections import Corrections
from gantrytau_optimica.learning.runs.reference import Reference
from gantrytau_optimica.learning.runs.robot_runs import Plant
from gantrytau_optimica.learning.runs.run_checks import check_run

SAMPLES = 6000  # of the experiment
HELD = 5  # samples, for which the sequence keeps its value
REGISTER = 10  # bits: a period of 1023 values
REST = 100  # samples before, by which sensors are set to zero
LAGS = 60  # samples, within which an answer begins
OWN = 20  # samples of its past that explain an output
SMALL = 1e-3  # of the largest part of an answer, below which it has not begun
SURE = 6.0  # deviations, from which it has begun
ORDERS = (1, 2, 3, 4, 6, 8, 10, 12, 14)  # that are tried
FAIR = 50.0  # % of what is measured, that a response must foretell


@dataclass(frozen=True, eq=False)
class Seen(Record):
    """What an estimator makes of all that it reads. widths: columns by letter; picked: those of the estimate that count."""

    estimator: Estimator
    widths: dict[str, int]
    picked: tuple[int, ...]
    period: float

    def of(self, answers: np.ndarray) -> np.ndarray:
        """Estimates (N, m, ...) of answers (N, p, ...), letter by letter."""
        edges = np.cumsum(list(self.widths.values()))[:-1]
        signals = dict(zip(self.widths, np.split(answers, edges, axis=1), strict=True))
        return self.estimator.combine(signals, self.period)[:, list(self.picked)]


@dataclass(frozen=True, eq=False, repr=False)
class EstimatedResponse(Record):
    """From corrections (N, m) to what is learnt from, F_u + F_y T_uy of Dressler (2012), (7.15).

    system: from corrections to all that the estimator reads, `delay` samples early; fit: of the estimate in the half of the
    samples that did not identify it, (m,) in %.
    """

    system: IdentifiedSystem
    delay: int
    seen: Seen
    fit: np.ndarray

    def __repr__(self) -> str:
        fit = ", ".join(f"{part:.1f}" for part in self.fit)
        return f"<EstimatedResponse: {self.system.title}, {self.delay} samples late, fits {fit} %>"

    @property
    def period(self) -> float:
        """The sampling period in s."""
        return self.seen.period

    @property
    def axes(self) -> int:
        """How many corrections there are."""
        return len(self.seen.picked)

    def lifted(self, samples: int) -> np.ndarray:
        """T (m N, m N), axis by axis."""
        h = np.zeros((samples, len(self.system.outputs), self.axes))
        h[self.delay :] = pulses(self.system, samples - self.delay)
        columns = toeplitz_blocks(h).reshape(h.shape[1], samples, -1).transpose(1, 0, 2)
        return self.seen.of(columns).transpose(1, 0, 2).reshape(self.axes * samples, -1)

    def response(self, hz: np.ndarray, samples: int = 1250) -> np.ndarray:
        """Frequency response (m, m, K) at hz (K,): of a correction in the middle of a run, as estimators look ahead."""
        h = np.zeros((2 * samples, len(self.system.outputs), self.axes))
        h[samples + self.delay :] = pulses(self.system, samples - self.delay)
        found = self.seen.of(h)
        t = self.period * np.arange(-samples, samples)
        return np.moveaxis(np.tensordot(np.exp(-2j * np.pi * np.outer(hz, t)), found, axes=1), 0, -1)


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
    _check_numbers("estimated_response", amplitude, order, seed)
    corrections = Corrections(plant.kinematics, estimator.joints, reference.moving)
    u, run = excited(plant, reference.r[0], corrections, amplitude, seed)
    signals = estimator.signals(run, plant.kinematics)
    widths = {letter: x.shape[1] for letter, x in signals.items()}
    y = np.hstack(list(signals.values()))
    u, y = u[REST:], y[REST:]
    delay = dead_time(u, y)
    u, y = u[: len(u) - delay], y[delay:]
    seen = Seen(estimator, widths, corrections.picked, plant.period)
    system, fit = _foretelling(seen, u, y, (order,) if order else ORDERS)
    return EstimatedResponse(system, delay, seen, fit)


def _check_numbers(place: str, amplitude: float, order: int | None, seed: int) -> None:
    amplitude = number(place, "amplitude", amplitude, above=0.0)
    if order is not None:
        whole(place, "order", order, least=1)
    whole(place, "seed", seed, least=0)


def excited(
    plant: Plant, place: np.ndarray, corrections: Corrections, amplitude: float, seed: int
) -> tuple[np.ndarray, Result]:
    """Binary sequences (REST + SAMPLES, m), apart by parts of their period, and the run of a plant that they correct."""
    held, apart = HELD * plant.period, (2**REGISTER - 1) // corrections.count
    t = plant.period * np.arange(SAMPLES)
    sequences = [
        prbs(REGISTER, held, amplitude, seed=0).values(t + apart * k * held).ravel()
        for k in range(corrections.count)
    ]
    u = np.vstack([np.zeros((REST, corrections.count)), np.column_stack(sequences)])
    r = np.tile(place, (len(u), 1))
    run = plant.run(*corrections.references(r, u, plant.period), seed=seed)
    check_run(run, len(u), plant)
    return u, run


def arm_model(
    plant: Plant, reference: Reference, *, order: int = 10, amplitude: float = 1e-3, seed: int = 0
) -> IdentifiedSystem:
    """How a tool moves about where stiff arms would hold it, from kinematics z_c to what gauges read, both (N, 3) in m.

    The plant is excited at rest where the reference begins, along all axes: the model that `Kalman` goes by, (6.13). Raises
    ModelError for a plant without gauges.
    """
    _check_numbers("arm_model", amplitude, order, seed)
    corrections = Corrections(plant.kinematics, False, (0, 1, 2))
    _, run = excited(plant, reference.r[0], corrections, amplitude, seed)
    z, r = (each.signals(run, plant.kinematics) for each in (Kinematic(), Measured()))
    return identify_system(z["z"][REST:], r["r"][REST:], order=order, period=plant.period)


def _foretelling(
    seen: Seen, u: np.ndarray, y: np.ndarray, orders: Sequence[int]
) -> tuple[IdentifiedSystem, np.ndarray]:
    """The system by the first half of samples that foretells the estimate in the second best, and how well, (m,) in %."""
    half = len(u) // 2
    estimate = seen.of(y[half:] - y[half:].mean(axis=0))
    size = np.linalg.norm(estimate - estimate.mean(axis=0), axis=0)
    found, words = list[tuple[float, IdentifiedSystem, np.ndarray]](), ""
    for order in orders:
        try:
            system = identify_system(u[:half], y[:half], order=order, period=seen.period)
        except IdentificationError as error:
            words = f"; {error}"
            continue
        left = seen.of(y[half:] - system.follow(u[half:], y[half:]))
        fit = 100 * (1 - np.linalg.norm(left, axis=0) / size)
        found.append((float(fit.min()), system, fit))
    best = max(found, key=lambda each: each[0], default=None)
    if best is None or best[0] < FAIR:
        there = f"{best[0]:.0f} % of the estimate foretold" if best else "no system that comes to rest"
        raise ModelError(
            f"estimated_response: found {there}, expected {FAIR:.0f} % at least; take "
            f"response=estimated_response(..., amplitude=0.003), or a model of your own{words}",
            argument="response",
        )
    return best[1], best[2]


def dead_time(u: np.ndarray, y: np.ndarray) -> int:
    """Samples after which outputs y (N, p) begin to answer to inputs u (N, m).

    By least squares of y(t) = sum a_i y(t - i) + sum b_j u(t - j) for each output: what is answered early cannot hide behind
    motion that rings for long, as its own past explains that.
    """
    forced = _lags(u, range(LAGS))
    least = LAGS
    for output in y.T:
        free = _lags(output[:, None], range(1, OWN + 1))
        regressors = np.hstack([forced, free, np.ones((len(free), 1))])
        sizes = np.maximum(np.linalg.norm(regressors, axis=0), np.finfo(float).tiny)
        _, R = np.linalg.qr(np.column_stack([regressors / sizes, output[LAGS:]]))
        found, *_ = np.linalg.lstsq(R[:-1, :-1], R[:-1, -1])
        inverse = np.linalg.pinv(R[:-1, :-1])
        deviation = np.linalg.norm(inverse, axis=1) * abs(R[-1, -1]) / np.sqrt(len(regressors) - len(found))
        answers = np.abs(found[: forced.shape[1]]).reshape(LAGS, -1)
        sure = answers > np.maximum(
            SURE * deviation[: forced.shape[1]].reshape(LAGS, -1), SMALL * answers.max()
        )
        least = min(least, int(np.argmax(sure.any(axis=1))) if sure.any() else LAGS)
    if least == LAGS:
        raise ModelError(
            "estimated_response: found nothing in what is measured that follows corrections; take "
            "response=estimated_response(..., amplitude=0.003), or look at the sensors"
        )
    return least


def _lags(x: np.ndarray, lags: range) -> np.ndarray:
    """Rows from LAGS on of signals (N, m), each so many samples later."""
    return np.hstack([x[LAGS - k : len(x) - k] for k in lags])
