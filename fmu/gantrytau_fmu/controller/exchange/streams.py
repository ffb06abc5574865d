"""Clients that stream: a file row by row, a sensor, and a function of what was measured, as a hand that is pushed back."""

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from gantrytau.border.checks import check_words, whole
from gantrytau.border.columns import TIMES, Columns
from gantrytau.border.refusal import ModelError
from gantrytau.inputs.samples import Samples
from gantrytau_fmu.controller.board import ACTIVATE
from gantrytau_fmu.controller.channels import Channel, Declaration, Values
from gantrytau_fmu.controller.clients import Sample
from gantrytau_fmu.controller.exchange.messages import SEQUENCES

SAME = 1e-6  # of a period, by which the first two times may differ from it
SHIFTED = 0.1  # of a period, by which rounding may shift those that follow


class _Answering:
    """Base of clients that answer every sample at once."""

    def __init__(self, name: str, sends: Declaration):
        self.name, self.sends = name, sends
        self._answer: Sample | None = None
        self._before: Sample | None = None
        self._seen = -1

    def submit(self, sample: Sample, declaration: Declaration) -> None:
        """Take sample k and make the answer to it."""
        self._seen = sample.k
        values = self._values(sample, declaration)
        if values is not None:
            self._before, self._answer = self._answer, Sample(sample.k, sample.time, values)

    def answer(self, k: int) -> Sample | None:
        """Its newest answer, of a sample not newer than k - 1."""
        return next((a for a in (self._answer, self._before) if a is not None and a.k <= k - 1), None)

    def settled(self, k: int) -> bool:
        """Whether it has seen sample k."""
        return self._seen >= k

    def close(self) -> None:
        """Nothing is held open."""

    def _values(self, sample: Sample, declaration: Declaration) -> Values | None:
        raise NotImplementedError


class FileStream(_Answering):
    """See `stream_file`."""

    def __init__(self, path: Path, name: str, at_end: Literal["hold", "stop"]):
        check_words(FileStream, {"at_end": at_end}, "stream_file")
        self.path, self.at_end, self.row = path, at_end, -1
        table, self.columns = _read(path)
        units = [table.unit(name) or "1" for name in self.columns]
        super().__init__(name, Declaration([Channel(c, u) for c, u in zip(self.columns, units, strict=True)]))
        self._times, self._rows = _numbers(path, self.columns)

    @property
    def state(self) -> str:
        """Where it is, in words."""
        if self.row < 0:
            return "waits for f_activate"
        if self.row < len(self._rows):
            return f"row {self.row + 1} of {len(self._rows)}"
        return f"at the end of {len(self._rows)} rows: " + (
            "holds the last" if self.at_end == "hold" else "stops"
        )

    def _values(self, sample: Sample, declaration: Declaration) -> Values | None:
        if ACTIVATE.name not in declaration:
            raise ModelError(
                f"{self.name}: found no {ACTIVATE.name} among what the controller publishes, expected it"
            )
        active = sample.values[declaration.slices[ACTIVATE.name]][0] >= 0.5
        if not active:
            self.row = -1
            return np.zeros(self.sends.size)
        if self.row < 0:
            self._times, self._rows = _numbers(self.path, self.columns)
            self._first, self._timed = sample, False
        self.row = (sample.k - self._first.k) % SEQUENCES  # so that one that was lost on its way shifts none
        if self.row < len(self._rows):
            self._check_time(sample)
            return self._rows[self.row]
        self.row = len(self._rows)
        return self._rows[-1] if self.at_end == "hold" else None

    def _check_time(self, sample: Sample) -> None:
        """One row is one sample, so their times have to go on alike."""
        if self._timed or self.row < 1 or not self._times.size:
            return
        self._timed = True
        expected = 1e-9 * (sample.time - self._first.time) / self.row
        found = self._times[1] - self._times[0]
        if abs(found - expected) > SAME * expected:
            raise ModelError(
                f"{self.path}: found rows {found:g} s apart for samples every {expected:g} s, expected one for each sample; "
                "resample the file"
            )
        due = self._times[0] + expected * np.arange(self._times.size)
        late = np.flatnonzero(np.abs(self._times - due) > SHIFTED * expected)
        if late.size:
            row = int(late[0])
            raise ModelError(
                f"{self.path}: found row {row + 1} at {self._times[row]:g} s, expected it at {due[row]:g} s, one row for "
                "each sample; fill in what is missing, or resample the file"
            )


class FunctionClient(_Answering):
    """A client that answers with a function of what the controller publishes: function(t, values) -> {name: value}.

    t: s; values: floats and vectors by name. What it returns has a value for each of `sends`. See also `stream_sensor`.
    """

    def __init__(
        self,
        name: str,
        sends: Sequence[Channel],
        function: Callable[[float, dict[str, Any]], Mapping[str, Any]],
    ):
        super().__init__(name, Declaration(sends))
        if not callable(function):
            raise ModelError(f"{name}: found {function!r}, expected a function of t and values")
        self.function = function

    def _values(self, sample: Sample, declaration: Declaration) -> Values | None:
        known = {
            c.name: float(sample.values[place.start]) if c.size == 1 else sample.values[place].copy()
            for c, place in zip(declaration, declaration.slices.values(), strict=True)
        }
        found = self.function(1e-9 * sample.time, known)
        if not isinstance(found, Mapping):
            raise ModelError(f"{self.name}: found {type(found).__name__}, expected values by name")
        return self.sends.vector(dict(found))


def stream_file(
    path: str | os.PathLike[str], *, name: str = "stream", at_end: Literal["hold", "stop"] = "hold"
) -> FileStream:
    """A client that streams a CSV file, a row for each sample, as corrections of learning control are written.

    Its columns, `name [unit]` ("1" without a unit), are what it sends; a first column `time` is not sent, and has to go on
    as samples do. The file is opened each time f_activate goes from 0 to 1, and read from its first row; while it is 0,
    zeros are sent. A sample that is lost on its way shifts no row. at_end: "hold" goes on with the last row, "stop"
    sends nothing more; `.state` says where it is. Raises ModelError for files that are no table of numbers.
    """
    check_words(stream_file, {"at_end": at_end})
    return FileStream(Path(path), name, at_end)


def stream_sensor(
    source: Callable[[float], float] | Samples,
    *,
    name: str = "sensor",
    channel: Channel | None = None,
) -> FunctionClient:
    """A client that sends what a sensor reads, one number a sample: a length gauge in m unless `channel` says otherwise.

    source: a function of time in s, or `Samples`. Raises ModelError for another.
    """
    sent = channel or Channel("length", "m")
    if isinstance(source, Samples):
        if source.shape not in ((), (1,)):
            raise ModelError(
                f"{name}: found samples of shape {source.shape}, expected one number at each time"
            )
        times, values = source.times, source.values[:, 0]
        held = source.kind == "constant"

        def read(t: float) -> float:
            if held:
                return float(values[max(int(np.searchsorted(times, t, side="right")) - 1, 0)])
            return float(np.interp(t, times, values))

        return FunctionClient(name, [sent], lambda t, _: {sent.name: read(t)})
    if not callable(source):
        raise ModelError(f"{name}: found {source!r}, expected a function of time, or Samples")
    function = source
    return FunctionClient(name, [sent], lambda t, _: {sent.name: function(t)})


def haptic_client(
    hand: Callable[[float, Values], Any],
    *,
    feels: str = "f_t",
    size: int = 3,
    name: str = "haptic",
) -> FunctionClient:
    """A haptic device: it feels a published force, and sends the force of the hand that holds it, both (size,) in N.

    hand(t, felt) -> force: what the hand does against the felt force; feels: name of the published force.
    """
    whole("haptic_client", "size", size, least=1)

    def push(t: float, values: dict[str, Any]) -> Mapping[str, Any]:
        if feels not in values:
            raise ModelError(
                f"{name}: found no '{feels}' among what the controller publishes, expected the force to feel"
            )
        return {"f": hand(t, np.atleast_1d(values[feels]))}

    return FunctionClient(name, [Channel("f", "N", size)], push)


def _read(path: Path) -> tuple[Columns, list[str]]:
    """The table of a file, and the names of the columns that are sent."""
    table = Columns.read(path, "rows of numbers")
    names = list(table.names)
    late = next((k for k, name in enumerate(names) if k and name in TIMES), None)
    if late is not None:
        raise ModelError(
            f"{path}: found '{names[late]}' as column {late + 1}, expected the time as the first one; it is not sent"
        )
    sent = names[names[0] in TIMES :]
    if not sent:
        raise ModelError(f"{path}: found no column beside the time, expected what is to be sent")
    return table, sent


def _numbers(path: Path, columns: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Times (N,), none without such a column, and rows (N, n) of a file, as they stand."""
    table, found = _read(path)
    if found != list(columns):
        raise ModelError(
            f"{path}: found the columns {', '.join(found)}, expected {', '.join(columns)} as at first"
        )
    rows = np.column_stack([table.column(name, filled=True, si=False) for name in columns])
    return (np.zeros(0) if table.time is None else table.time), rows
