"""The log of a run: every sample as a row for the result, and as a line of JSON in a file if one is wanted."""

import json
import os
from collections.abc import Sequence
from types import TracebackType
from typing import Any, Self

import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau_fmu.controller.channels import Channel, Declaration, Values

ROWS = 1024  # made room for at first; then always twice as many


class SampleLog:
    """Rows of numbers, and lines `{"type": "declare" | "sample" | "state" | "set" | "end", ...}` where a file is named.

    channels: what a row consists of. Lines appear as they are made, so that an interrupt loses none.
    """

    def __init__(self, channels: Sequence[Channel], period: float, file: str | os.PathLike[str] | None):
        self.declaration = Declaration(channels)
        self.period, self.count = period, 0
        self._rows = np.empty((ROWS, self.declaration.size))
        try:
            self._file = None if file is None else open(file, "w", 1, encoding="utf-8", newline="\n")  # noqa: SIM115
        except OSError as error:
            raise ModelError(
                f"log: cannot write {file} ({error.strerror}), expected a file in a folder that is there",
                argument="log",
            ) from None
        declared = [{"name": c.name, "unit": c.unit, "size": c.size} for c in channels]
        self.tell("declare", period=period, channels=declared)

    def add(self, values: Values) -> None:
        """One more sample."""
        if self.count == len(self._rows):
            self._rows = np.concatenate([self._rows, np.empty_like(self._rows)])
        self._rows[self.count] = values
        if self._file is not None:
            self.tell("sample", k=self.count, values=values.tolist())
        self.count += 1

    def tell(self, kind: str, **more: Any) -> None:
        """One line of the file."""
        if self._file is not None:
            self._file.write(json.dumps({"type": kind, **more}) + "\n")

    @property
    def rows(self) -> Values:
        """What there is, (samples, n)."""
        return self._rows[: self.count]

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._file is not None:
            self._file.close()
