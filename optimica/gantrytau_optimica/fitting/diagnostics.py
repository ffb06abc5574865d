"""One look at what a fit leaves, the same for every fit: `diagnose`.

e: what is left; X: Jacobian by what was fitted; x: a known signal, beside X
explained   F = (|y|^2 - |e|^2) / k / (|e|^2 / (n - k))           n: rows that count as independent
size        chi^2 = sum (e / told)^2
whiteness   r = sum e_i e_(i+1) / |e|^2,      deviation 1 / sqrt(N)
trend       c = x'e / x'x,                    deviation sqrt(x' cov(e) x) / x'x, cov(e) by the spectrum of e - c x
strays, groups: amounts beside their median, of a fit that strays do not lead
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from gantrytau.describing.record import Record
from gantrytau_optimica.fitting.covariance import averaged_spectrum, independent_share, product_covariance
from gantrytau_optimica.fitting.facts import Fact
from gantrytau_optimica.fitting.finding import Finding, rows_in_words
from gantrytau_optimica.fitting.robust import limit, robust_deviation, without_strays

CHANCE = 1e-5  # of a finding on sound data, by each test
NOTHING = 0.01  # chance of as much without any effect, above which a fit explains nothing
SURE = 5.0  # deviations, of a trend: its spectrum is an estimate
FOLLOWS = 0.1  # of what is left, that a trend must be to be told
COMPUTED = 1e-6  # of the signal: what computed data leave, that have no noise
ALIKE = ("explains nothing", "not white")  # facts that quantities have together
FEW = 8  # rows, below which nothing is asked
ACCIDENT = 4  # rows that are the same, below which that may be one
CLIPPED = 5.0  # robust deviations: a single stray is no group


@dataclass(frozen=True, eq=False)
class ResidualSeries:
    """Residuals of one quantity in one run, in the order of measurement.

    name: of the quantity, the same in all runs; left: measured less model (N,), NaN in rows that do not count; measured:
    what the fit was to explain (N,); noise: told deviations, a number or (N,); jacobian: derivatives of it by what was
    fitted (N, k); signals: known ones (N,) that it may follow, "q of x", "v of x", "a of x", "sign v of x", "1", "time" in
    s, "poses": their numbers, or "rate": that of the measured; groups: labels (N,) by kind, "pose", "image", "run",
    "sensor"; rows: their numbers in the data; run: its name, where there are several; band: share of the frequencies that a
    filter has left.
    """

    name: str
    left: np.ndarray
    measured: np.ndarray | None = None
    noise: np.ndarray | float | None = None
    jacobian: np.ndarray | None = None
    signals: Mapping[str, np.ndarray] = field(default_factory=dict)
    groups: Mapping[str, np.ndarray] = field(default_factory=dict)
    rows: np.ndarray | None = None
    run: str = ""
    band: float = 1.0

    @cached_property
    def used(self) -> np.ndarray:
        """Which rows count, (N,)."""
        return np.isfinite(self.left)

    @property
    def numbers(self) -> np.ndarray:
        """Numbers of the rows that count."""
        return (np.arange(len(self.left)) if self.rows is None else np.asarray(self.rows))[self.used]

    def filled(self, values: np.ndarray) -> np.ndarray:
        """Values (m,) of the rows that count among zeros, (N,)."""
        found = np.zeros(len(self.left))
        found[self.used] = values
        return found


@dataclass(frozen=True, eq=False)
class Diagnostics(Record):
    """Statistics of residuals by the name of the quantity, with the significant facts.

    explained: share of the signal; ratio: size over told noise; correlation: of neighbours; trends: share of what is left by
    the signal that it follows most. Quantities of which something is not known, or not asked, are missing there.
    """

    explained: Mapping[str, float]
    ratio: Mapping[str, float]
    correlation: Mapping[str, float]
    trends: Mapping[str, tuple[str, float]]
    facts: tuple[Fact, ...]

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The facts in words, the likeliest causes first; what all quantities have alike is told once."""
        told: dict[str, Fact] = {}
        for k, fact in enumerate(self.facts):
            key = fact.kind if fact.kind in ALIKE else f"{fact.kind} {k}"
            before = told.get(key)
            told[key] = (
                fact if before is None else replace(before, quantity=f"{before.quantity}, {fact.quantity}")
            )
        return tuple(fact.finding for fact in told.values())


@dataclass(frozen=True, eq=False)
class _Quantity:
    """All series of one quantity; left and jacobian of the rows that count, one run after another."""

    name: str
    series: Sequence[ResidualSeries]

    @cached_property
    def left(self) -> np.ndarray:
        return np.concatenate([s.left[s.used] for s in self.series])

    @cached_property
    def jacobian(self) -> np.ndarray:
        """An orthonormal base of the Jacobian."""
        parts = [np.zeros((len(s.left), 0)) if s.jacobian is None else s.jacobian for s in self.series]
        J = np.concatenate([part[s.used] for s, part in zip(self.series, parts, strict=True)])
        sizes = np.linalg.norm(J, axis=0)
        U, size, _ = np.linalg.svd(J[:, sizes > 0] / sizes[sizes > 0], full_matrices=False)
        return U[:, size > 1e-9 * np.max(size, initial=0.0)]

    @cached_property
    def freedom(self) -> float:
        """Rows that count as independent, less what was fitted."""
        share = independent_share(np.concatenate([self.spectrum(s, s.left[s.used]) for s in self.series]))
        return max(share * (len(self.left) - self.jacobian.shape[1]), 1.0)

    @cached_property
    def robust(self) -> np.ndarray:
        return without_strays(self.left, self.jacobian)

    @cached_property
    def scale(self) -> float:
        return robust_deviation(self.robust, self.jacobian.shape[1])

    def spectrum(self, series: ResidualSeries, left: np.ndarray) -> np.ndarray:
        """Spectrum of the residuals of one run, in the rows that count."""
        return averaged_spectrum(series.filled(left), used=max(float(np.mean(series.used)), 1e-9))

    def of(self, series: ResidualSeries) -> slice:
        """The rows of one run."""
        begin = 0
        for one in self.series:
            end = begin + int(np.sum(one.used))
            if one is series:
                return slice(begin, end)
            begin = end
        raise KeyError(series.name)

    def together(self, values: Sequence[np.ndarray | float | None]) -> np.ndarray | None:
        """Values of all runs in the rows that count; None where one does not have them."""
        if any(v is None for v in values):
            return None
        pairs = zip(self.series, values, strict=True)
        return np.concatenate([np.broadcast_to(np.asarray(v, float), s.left.shape)[s.used] for s, v in pairs])


def diagnose(
    series: Sequence[ResidualSeries],
    *,
    known: Sequence[Fact] = (),
    remedies: Mapping[str, str] | None = None,
) -> Diagnostics:
    """Diagnostics of residuals. known: facts beside it, of limits, fixed values and repeated data; remedies: what to
    do by kind of fact, where the fit knows better.
    """
    found: tuple[dict, dict, dict, dict] = ({}, {}, {}, {})
    facts: list[Fact] = []
    quantities = [
        _Quantity(n, [s for s in series if s.name == n]) for n in dict.fromkeys(s.name for s in series)
    ]
    asked = []
    for one in quantities:
        count, square = len(one.left), float(one.left @ one.left)
        measured, noise = (one.together([getattr(s, n) for s in one.series]) for n in ("measured", "noise"))
        whole = float(measured @ measured) if measured is not None else 0.0
        if whole > 0:
            found[0][one.name] = 1.0 - square / whole
        if count < FEW or count <= one.jacobian.shape[1] + 2 or not square > COMPUTED**2 * whole:
            continue
        own = list(_explained(one, measured))
        size = [] if noise is None else list(_size(one, noise, found[1]))
        if not any(f.kind == "noise smaller" for f in size):
            own += _of_order(one, found[2], found[3])
            asked.append(one)
        facts += [*own, *size]
    facts = [*_groups(asked, facts), *facts, *known]
    return Diagnostics(
        *found, tuple(replace(f, remedy=(remedies or {}).get(f.kind, f.remedy)) for f in facts)
    )


def repeated(courses: Mapping[str, np.ndarray]) -> list[Fact]:
    """Courses by name, rows (N, k) of numbers with noise, of which most stand in another one too."""
    seen = {
        name: {row.tobytes() for row in np.ascontiguousarray(rows, dtype=float)}
        for name, rows in courses.items()
    }
    return [
        Fact("duplicates", name, float(len(seen[name] & seen[other])), cause=other)
        for (j, name), other in ((pair, o) for pair in enumerate(seen) for o in list(seen)[: pair[0]])
        if len(seen[name] & seen[other]) > max(ACCIDENT - 1, min(len(seen[name]), len(seen[other])) / 2)
    ]


def repeated_rows(name: str, values: np.ndarray, rows: np.ndarray) -> list[Fact]:
    """Rows (N, k) of numbers with noise that are the same as earlier ones; rows: their numbers in the data."""
    _, first, which = np.unique(values, axis=0, return_index=True, return_inverse=True, equal_nan=True)
    before = first[which.ravel()]
    again = np.flatnonzero(before != np.arange(len(values)))
    if not again.size:
        return []
    cause = f"{name} of {rows_in_words(rows[before[again]])}"
    return [Fact("duplicates", rows_in_words(rows[again]), float(again.size), rows[again], cause)]


def _explained(one: _Quantity, measured: np.ndarray | None) -> Iterator[Fact]:
    from scipy.special import fdtrc

    if measured is None or all(s.jacobian is None for s in one.series):
        return
    k, whole, rest = one.jacobian.shape[1], float(measured @ measured), float(one.left @ one.left)
    gained = max(whole - rest, 0.0) / max(k, 1) / (rest / one.freedom)
    chance = float(fdtrc(k, one.freedom, gained)) if k else float(gained <= 0)
    if chance > NOTHING:
        share = max(whole - rest, 0.0) / max(whole, 1e-300)
        yield Fact("explains nothing", one.name, share=share, probability=chance)


def _size(one: _Quantity, noise: np.ndarray, ratios: dict[str, float]) -> Iterator[Fact]:
    from scipy.special import chdtr, chdtrc

    square = float(np.mean((one.left / noise) ** 2)) * len(one.left) / (len(one.left) - one.jacobian.shape[1])
    ratios[one.name] = float(np.sqrt(square))
    for kind, chance in (("noise larger", chdtrc), ("noise smaller", chdtr)):
        probability = float(chance(one.freedom, square * one.freedom))
        if probability < CHANCE:
            yield Fact(kind, one.name, ratios[one.name], probability=probability)


def _of_order(
    one: _Quantity, correlations: dict[str, float], trends: dict[str, tuple[str, float]]
) -> Iterator[Fact]:
    """Trend of the residuals, else correlation of neighbours, else strays."""
    followed = max(_trends(one), key=lambda f: f.share, default=None)
    if followed is not None:
        trends[one.name] = followed.cause, followed.share
    correlation, pairs = _correlation(one)
    correlations[one.name] = correlation
    from scipy.special import ndtri

    least = -float(ndtri(CHANCE / 2)) / np.sqrt(max(pairs, 1.0))
    if followed is not None and followed.deviations > SURE and followed.share > FOLLOWS:
        yield followed
        return
    most = limit(len(one.left) - one.jacobian.shape[1])
    if correlation > least:
        most *= 2  # of noise that is not white, and not quite normal
        yield Fact("not white", one.name, correlation, held=least)
    for s in one.series if one.scale > 0 else ():
        far = np.abs(one.robust[one.of(s)]) / one.scale
        if np.any(far > most):
            name = f"{one.name} of {s.run}" if len(one.series) > 1 and s.run else one.name
            yield Fact("outliers", name, float(far.max()), s.numbers[far > most])


def _correlation(one: _Quantity) -> tuple[float, float]:
    """Correlation of neighbours that a filter keeps independent, and the number of pairs. Strays count as noise."""
    most = CLIPPED * max(robust_deviation(one.left), 1e-300)
    product = square = pairs = 0.0
    for s in one.series:
        step = max(1, int(np.ceil(1 / s.band - 1e-9)))
        for begin in range(step):
            e = np.clip(s.left[begin::step], -most, most)
            both = np.isfinite(e[1:]) & np.isfinite(e[:-1])
            product += float(e[1:][both] @ e[:-1][both])
            pairs += np.sum(both) / step
            square += float(np.sum(e[1:][both] ** 2 + e[:-1][both] ** 2)) / 2
    return (product / square if square > 0 else 0.0), pairs


def _trends(one: _Quantity) -> Iterator[Fact]:
    names = dict.fromkeys(n for s in one.series for n in s.signals)
    whole = float(one.left @ one.left)
    for name in names:
        x = one.together([s.signals.get(name, 0.0) for s in one.series])
        if x is None or not np.all(np.isfinite(x)):
            continue
        own = x - one.jacobian @ (one.jacobian.T @ x)
        size = float(own @ own)
        if not size > 1e-9 * float(x @ x):
            continue
        slope = float(own @ one.left) / size
        rest = one.left - slope * own
        variance = 0.0
        for s in one.series:
            here = one.of(s)
            column = s.filled(own[here])[:, None]
            variance += float(product_covariance(column, one.spectrum(s, rest[here]))[0, 0])
        variance *= len(x) / max(len(x) - one.jacobian.shape[1] - 1, 1)
        share = slope**2 * size / whole
        deviations = abs(slope) * size / np.sqrt(variance) if variance > 0 else np.inf
        kind = {"time": "drift", "poses": "drift", "rate": "delay"}.get(name, "trend")
        amount = -slope if kind == "delay" else slope
        yield Fact(kind, one.name, amount, cause=name, share=share, deviations=float(deviations))


def _groups(quantities: Sequence[_Quantity], facts: list[Fact]) -> Iterator[Fact]:
    """Groups that leave more than the others, in robust deviations of their quantity; strays in them are theirs."""
    from scipy.special import chdtrc

    members: dict[tuple[str, object], list[tuple[float, int]]] = {}
    for one in quantities:
        for s in one.series if one.scale > 0 else ():
            sizes = np.abs(one.robust[one.of(s)]) / one.scale
            for kind, labels in s.groups.items():
                for label, size, row in zip(
                    np.asarray(labels)[s.used].tolist(), sizes, s.numbers, strict=True
                ):
                    members.setdefault((kind, label), []).append((float(size), int(row)))
    for (kind, label), told in members.items():
        others = sum(len(each) for (other, _), each in members.items() if other == kind) - len(told)
        sizes = np.array([size for size, _ in told])
        square = float(np.sum(np.minimum(sizes, CLIPPED) ** 2))
        groups = sum(other == kind for other, _ in members)
        if others < len(told) or chdtrc(len(told), square) * groups > CHANCE:
            continue
        rows = np.unique([row for _, row in told])
        facts[:] = [f for f in facts if f.kind != "outliers" or not np.isin(f.rows, rows).all()]
        size = float(np.sqrt(np.mean(sizes**2)))
        yield Fact("group", f"{kind} {label}", size, rows, cause=f"{kind} {label}")
