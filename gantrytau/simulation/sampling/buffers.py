"""Hundreds of passages in one call, from and to memory of NumPy."""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from gantrytau.kernels import Kernel
from gantrytau.simulation.full_coordinates import Coordinates
from gantrytau.simulation.sampling.sampling_interval import Passage, passage

CALLS = (1, 8, 64, 512, 2048, 4096)  # passages in one call
LONGEST_CALL = 40_000_000  # instructions: some tenths of a second, for which Ctrl-C has to wait
WORTH = 10_000  # passages of a model: for so many it is compiled, which takes as long as these


@dataclass(frozen=True)
class StepsTaken:
    """States and what is held before and behind each step, the two estimates of its error, and the algebraics just before
    what is due behind it, a row each.
    """

    before: np.ndarray
    after: np.ndarray
    third: np.ndarray
    fifth: np.ndarray
    algebraics: np.ndarray


class Buffer:
    """Memory of a call of so many passages, a row each."""

    def __init__(self, calls: ca.Function, size: int):
        self._first = np.zeros(calls.size1_in(0))
        self._told = np.zeros((size, calls.size1_in(1)))
        self._found = [np.zeros((size, calls.size1_out(k))) for k in range(calls.n_out())]
        self._memory, self._go = calls.buffer()
        for k, array in enumerate((self._first, self._told)):
            self._memory.set_arg(k, array.data)
        for k, array in enumerate(self._found):
            self._memory.set_res(k, array.data)

    def steps(self, first: np.ndarray, told: np.ndarray) -> StepsTaken:
        """Passages from the first states and what is held, one behind the other, told (steps, k) as `Passage` says."""
        count = len(told)
        self._first[:] = first
        self._told[:count] = told
        self._told[count:] = told[-1]
        self._told[count:, 1] = 0.0  # what is left of the call stands still
        self._go()
        after, third, fifth, *rest = (array[:count] for array in self._found)
        algebraics = rest[0] if rest else np.zeros((count, 0))
        return StepsTaken(np.vstack([first[None], after[:-1]]), after, third, fifth, algebraics)


class Passages:
    """Passages of a model, by its kernel where there is one."""

    def __init__(self, coordinates: Coordinates):
        self.coordinates = coordinates
        self._buffers: dict[int, Buffer] = {}

    @property
    def one(self) -> Passage:
        """A single one."""
        return self.coordinates.kept("passage", lambda: passage(self.coordinates))

    @cached_property
    def calls(self) -> tuple[int, ...]:
        """How many there may be in one call."""
        return tuple(k for k in CALLS if k == 1 or k * self.one.instructions <= LONGEST_CALL)

    def steps(self, first: np.ndarray, told: np.ndarray, size: int, expected: float) -> StepsTaken:
        """As of `Buffer`, in a call of `size`; expected: how many are left of the run."""
        so_far = self.coordinates.kept("passages so far", lambda: np.zeros(1))
        many = bool(so_far[0] + expected > WORTH)
        so_far += len(told)
        if self._kernel.called(len(told), expected, begin=many):
            self._buffers.clear()
        if size not in self._buffers:
            self._buffers[size] = self._buffer(size)
        return self._buffers[size].steps(first, told)

    def _buffer(self, size: int) -> Buffer:
        function = self._kernel.function
        calls = self.coordinates.kept(
            ("passages", size, function.class_name()),
            lambda: function if size == 1 else function.mapaccum("passages", size),
        )
        return Buffer(calls, size)

    @property
    def _kernel(self) -> Kernel:
        return self.coordinates.kept(
            "kernel of passages", lambda: Kernel(self.one.function, self.one.instructions, priority=0)
        )
