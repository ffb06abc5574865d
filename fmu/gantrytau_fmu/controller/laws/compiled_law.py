"""A user's controller in C: a shared library with three names.

    const char *gantrytau_values = "q v sensor.length f_activate";   /* what it takes, vectors whole, in this order */
    const char *gantrytau_references = "q_ref";                      /* what it gives */
    int gantrytau_sample(int64_t k, double time, const double *values, double *references);

`references` come in as they are without it, and are to be overwritten; time is in s, k the number of the sample. It answers
0, anything else ends the run. What it computes is its own matter, what becomes of it is not: limits are kept outside.
"""

import ctypes
import os
from pathlib import Path

import numpy as np

from gantrytau.border.refusal import ModelError, SolveError, did_you_mean
from gantrytau_fmu.controller.board import Board
from gantrytau_fmu.controller.channels import Declaration, Values

SUFFIXES = (".so", ".dylib", ".dll")


class CompiledLaw:
    """A shared library as a controller, see above. Raises ModelError for a file that is none, or lacks one of the names."""

    tunables, tuned = Declaration(), np.zeros(0)

    def __init__(self, path: str | os.PathLike[str]):
        self._path = Path(path).resolve()
        if not self._path.is_file():
            raise ModelError(f"controller: found no file {path}, expected a shared library")
        try:
            library = ctypes.CDLL(str(self._path))
            names = [
                ctypes.c_char_p.in_dll(library, word) for word in ("gantrytau_values", "gantrytau_references")
            ]
            self._sample = library.gantrytau_sample
        except (OSError, ValueError, AttributeError) as error:
            raise ModelError(
                f"controller: found {path}, expected a shared library with gantrytau_values, gantrytau_references and "
                f"gantrytau_sample: {error}"
            ) from None
        numbers = ctypes.POINTER(ctypes.c_double)
        self._sample.argtypes = [ctypes.c_int64, ctypes.c_double, numbers, numbers]
        self._sample.restype = ctypes.c_int
        self._takes, self._gives = ((name.value or b"").decode(errors="replace").split() for name in names)

    def fit(self, board: Board, references: Declaration) -> None:
        """What it takes and gives by place; ModelError for names that there are not."""
        for names, there in ((self._takes, board.declaration), (self._gives, references)):
            for name in names:
                if name not in there:
                    raise ModelError(
                        f"controller: {self._path.name} names '{name}', expected one of those that there are"
                        f"{did_you_mean(name, there.names)}"
                    )
        if not self._gives:
            raise ModelError(
                f"controller: {self._path.name} gives no reference, expected names in gantrytau_references"
            )
        self._board = board
        self._taken = [board.declaration.slices[name] for name in self._takes]
        self._given = [references.slices[name] for name in self._gives]

    def begin(self, stop: float) -> None:
        """Nothing to prepare."""

    def set(self, name: str, values: Values) -> None:
        """It has no parameters of its own."""

    def references(self, k: int, time: float, period: float, nominal: Values) -> Values:
        """See `Law.references`; SolveError where it does not answer 0."""
        pointer = ctypes.POINTER(ctypes.c_double)
        values = np.concatenate([self._board.values[place] for place in self._taken] or [np.zeros(1)])
        given = np.concatenate([nominal[place] for place in self._given])
        code = self._sample(k, time, values.ctypes.data_as(pointer), given.ctypes.data_as(pointer))
        if code:
            raise SolveError(
                f"controller: {self._path.name} answered {code} in sample {k} at t = {time:.6g} s, expected 0",
                time=time,
            )
        wanted, start = nominal.copy(), 0
        for place in self._given:
            size = place.stop - place.start
            wanted[place] = given[start : start + size]
            start += size
        return wanted

    def close(self) -> None:
        """The library stays loaded."""
