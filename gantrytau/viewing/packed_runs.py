"""Runs as the page of results holds them: each constant, alias and equal signal once, values as integers, deflated."""

import base64
import json
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gantrytau.border.refusal import Given, ModelError, did_you_mean
from gantrytau.results.display_units import DECLARED, Display, Shown, shown_units
from gantrytau.results.passages import PassedLimit, passages
from gantrytau.results.series import Series

LARGEST = 5e7  # numbers of a page
BLOCK = 2e5  # numbers that are packed, and unpacked in the browser, together
# numbers up to which a value has so many bits of its range
BITS = ((2e6, 30), (8e6, 24), (16e6, 20), (LARGEST, 16))
FEW = 12  # values of a signal that is drawn as bands
TINY = np.finfo(float).tiny  # the least step, of numbers without any range that is worth it
MISSING = -1  # integer of a value that is not finite

Reference = float | list[int] | None  # of a variable in a run: its constant, or column and sign


@dataclass
class DistinctSignals:
    """The distinct signals of one run, (times,) each: one that is equal or opposite to another is stored as that."""

    signals: list[np.ndarray] = field(default_factory=list)
    known: dict[float, list[int]] = field(default_factory=dict)

    def add(self, values: np.ndarray) -> Reference:
        """Where a signal stands: its constant, or [column, sign]."""
        if (values == values[0]).all():
            return float(values[0]) if np.isfinite(values[0]) else None
        finite = np.isfinite(values)
        if not finite.any():
            return None
        with np.errstate(over="ignore"):
            total = float(values[finite].sum())
        sign = -1 if total < 0 else 1
        same = self.known.setdefault(abs(total), [])
        for column in same:
            for turned in (sign, -sign):
                if np.array_equal(self.signals[column], turned * values, equal_nan=True):
                    return [column, turned]
        same.append(len(self.signals))
        self.signals.append(sign * values)
        return [same[-1], sign]


def packed(
    runs: Sequence[Series],
    titles: Sequence[str],
    names: Sequence[str] = (),
    first: Sequence[str] = (),
    display: Display = None,
    scene: dict[str, Any] | None = None,
) -> list[str]:
    """Texts in base64: what is said of runs and variables first, as JSON, then the blocks of numbers that it counts.

    names: variables and components, none for all; first: those that are drawn at first; display: units as of `Result.plot`;
    scene: what is told of the model beside. ModelError for unknown names, and for more numbers than a page can hold.
    """
    begun = list(dict.fromkeys(name for found in _chosen(runs, first, "first") for name in found))
    chosen = _chosen(runs, [*names, *begun] if names else [""], "names")
    _small_enough(runs, chosen)
    variables: dict[tuple[str, str], dict[str, Any]] = {}
    held = [DistinctSignals() for _ in runs]
    for k, (run, scalars, title) in enumerate(zip(runs, chosen, titles, strict=True)):
        shown = shown_units(run, ("time", *scalars), display, DECLARED, "browse")
        for name in scalars:
            said = variables.setdefault((name, shown[name].unit), _told(run, name, shown[name], len(runs)))
            said["runs"][k] = _reference(run, name, held[k])
            _as_bands(run, name, said)
        for one in passages(run):
            told_of = variables.get((one.name, shown[one.name].unit)) if one.name in shown else None
            if told_of is not None:
                told_of.setdefault("beyond", []).append(
                    _beyond(one, shown[one.name], title if len(runs) > 1 else "")
                )
    total = sum(len(columns.signals) * run.time.size for run, columns in zip(runs, held, strict=True))
    bits = next(few for most, few in BITS if total <= most)
    blocks: list[bytes] = []
    records = []
    for run, title, columns in zip(runs, titles, held, strict=True):
        time, blocks = len(blocks), [*blocks, run.time.astype("<f8").tobytes()]
        record = {"title": title, "ended": run.ended, "size": run.time.size, "time": time, "columns": []}
        records.append(record)
        for signals in _together(columns.signals, run.time.size):
            record["columns"] += _coded(signals, bits, blocks)
    told = {
        "runs": records,
        "scene": scene,
        "first": begun,
        "variables": list(variables.values()),
        "bits": bits,
    }
    head = json.dumps(told, allow_nan=False, separators=(",", ":")).encode()
    return [_text(block) for block in (head, *blocks)]


def _chosen(runs: Sequence[Series], names: Sequence[str], argument: str) -> list[list[str]]:
    """The scalars of each run that are named, alone, as part of a vector or of a component, "" for all.

    ModelError for a name that no run has.
    """
    chosen: list[dict[str, None]] = [{} for _ in runs]
    for name in names:
        for run, found in zip(runs, chosen, strict=True):
            inside = run.names if not name else [one for one in run.names if _within(one, name)]
            found.update(dict.fromkeys(inside))
        if name and not any(name in run or any(_within(one, name) for one in run.names) for run in runs):
            known = [one for run in runs for one in (*run.names, *run.arrays)]
            words = f"expected the name of a variable or component{did_you_mean(name, known)}"
            raise ModelError(words, place="browse", found=Given(argument, name))
    return [list(found) for found in chosen]


def _within(scalar: str, name: str) -> bool:
    """Whether a scalar is what is named, an element of it, or a variable of that component; `der(x)` where x is."""
    inner = scalar.removeprefix("der(")
    return (
        scalar == name
        or inner.startswith((f"{name}.", f"{name}["))
        or (name.startswith("der(") and scalar.startswith(f"{name.removesuffix(')')}["))
    )


def _small_enough(runs: Sequence[Series], chosen: Sequence[Sequence[str]]) -> None:
    """ModelError for more numbers than a page can hold, before they are looked at."""
    total = sum(
        run.time.size * sum(name not in run.aliases for name in scalars)
        for run, scalars in zip(runs, chosen, strict=True)
    )
    if total > LARGEST:
        raise too_large(total, max(map(len, chosen)))


def too_large(numbers: float, variables: int) -> ModelError:
    """What is said of a result that a page cannot hold."""
    return ModelError(
        f"found {variables} variables with {8e-6 * numbers:,.0f} MB of numbers, expected at most {8e-6 * LARGEST:,.0f} MB; "
        "choose variables or components, names=['tool.r', 'carts[0]'], or simulate with fewer points",
        place="browse",
        argument="names",
    )


def _told(run: Series, name: str, shown: Shown, runs: int) -> dict[str, Any]:
    """What the page is told of a variable. scale: [a, b] where a x + b is shown of x in SI."""
    said: dict[str, Any] = {"name": name, "unit": shown.unit, "runs": [None] * runs}
    if words := run.description(name):
        said["words"] = words
    if shown.scale is not None:
        zero, one = (float(shown.of(x)) for x in (0.0, 1.0))
        said["scale"] = [one - zero, zero]
    if name in run.held:
        said["held"] = 1
    if name in run.limits:
        said["limits"] = [float(shown.of(end)) if np.isfinite(end) else None for end in run.limits[name]]
    return said


def _beyond(found: PassedLimit, shown: Shown, run: str) -> str:
    """How a variable passes a limit, in words: which run, which limit, when and by how much."""
    limit, worst = float(shown.of(found.limit)), float(shown.of(found.worst))
    unit = f" {shown.unit}" if shown.unit.strip("1") else ""
    return (
        f"{f'{run}: ' if run else ''}beyond its {found.side} of {limit:.6g}{unit} from t = {found.time:.5g} s, by up to "
        f"{abs(worst - limit):.3g}{unit}"
    )


def _reference(run: Series, name: str, columns: DistinctSignals) -> Reference:
    target = run.aliases.get(name, name)
    found = columns.add(run[target.removeprefix("-")])
    if not target.startswith("-") or found is None:
        return found
    return [found[0], -found[1]] if isinstance(found, list) else -found


def _as_bands(run: Series, name: str, said: dict[str, Any]) -> None:
    """Say of a mode, a boolean or a small integer that it is drawn as bands, with the names of its values."""
    if name in run.modes:
        said["modes"] = list(run.modes[name])
    elif not said["unit"].strip("1") and isinstance(said["runs"][-1] or said["runs"][0], list):
        values = run[name]
        if (name in run.held and _whole(values)) or _boolean(values):
            said.setdefault("modes", [])


def _boolean(values: np.ndarray) -> bool:
    """Whether there is nothing but 0 and 1, and more than a ramp has."""
    return values.size > 2 and bool(((values == 0) | (values == 1)).all())


def _whole(values: np.ndarray) -> bool:
    return bool((values == np.rint(values)).all()) and np.unique(values).size <= FEW


def _together(signals: Sequence[np.ndarray], size: int) -> Iterator[np.ndarray]:
    """Signals in groups that are packed together, (signals, times) each."""
    step = max(1, int(BLOCK / size))
    for k in range(0, len(signals), step):
        yield np.stack(signals[k : k + step])


def _coded(signals: np.ndarray, bits: int, blocks: list[bytes]) -> list[list[float]]:
    """Signals (k, times) as a further block; of each [block, row, rows, order, least, step]: value = (integer + least) step.

    Integers have `bits` bits of the range of a signal. Stored are their differences of the order that makes these smallest,
    the sign in the lowest bit: the lowest bytes of all, then as many higher ones as there are. A step is a power of two, so
    that zero and whole numbers stay exact.
    """
    finite = np.isfinite(signals)
    known = np.where(finite, signals, np.nan)
    low, high = np.nanmin(known, axis=1), np.nanmax(known, axis=1)
    exponent = np.ceil(np.log2(np.maximum(high / 2 - low / 2, TINY))) + 1 - bits
    step = np.exp2(np.maximum(exponent, -1022.0))
    least = np.floor(low / step)
    integers = np.where(finite, np.rint(signals / step[:, None] - least[:, None]), MISSING).astype(np.int32)
    order = np.zeros(len(signals), dtype=int)
    best, found = integers, np.full(len(signals), np.inf)
    differences = integers
    for k in range(5):
        size = np.abs(differences.astype(np.float32)).sum(axis=1)
        better = size < found
        order[better], found[better] = k, size[better]
        best = np.where(better[:, None], differences, best)
        differences = np.diff(differences, axis=1, prepend=np.int32(0))
    signless = ((best << 1) ^ (best >> 31)).view(np.uint32)
    count = max(1, (int(signless.max()).bit_length() + 7) // 8)
    planes = signless.astype("<u4").view(np.uint8).reshape(*signless.shape, 4)[..., :count].transpose(2, 0, 1)
    block = len(blocks)
    blocks.append(planes.tobytes())
    return [
        [block, row, len(signals), int(order[row]), float(least[row]), float(step[row])]
        for row in range(len(signals))
    ]


def _text(block: bytes) -> str:
    """A block deflated, in base64."""
    packer = zlib.compressobj(6, zlib.DEFLATED, 15, 9, zlib.Z_RLE)
    return base64.b64encode(packer.compress(block) + packer.flush()).decode()
