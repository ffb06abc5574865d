"""Ways that were checked, kept on file while others are: an interruption loses seconds of them."""

import time
from dataclasses import dataclass

import numpy as np

from gantrytau_optimica.procedure.motion_planning.clear_ways import clear_ways
from gantrytau_optimica.procedure.robot_samples import Fleet
from gantrytau_optimica.procedure.stages import Stages

PART = 25  # ways that are checked together
OFTEN = 1.0  # s between two files


@dataclass(frozen=True, eq=False)
class Ways:
    """Ways from a (N, n) to b (N, n), and whether they are clear (N,)."""

    a: np.ndarray
    b: np.ndarray
    clear: np.ndarray


class KnownWays:
    """`clear_ways` that remembers, in the stage "known_ways" of a folder; depends: digest of fleet and limits."""

    def __init__(self, stages: Stages, depends: str):
        self._stages, self._depends = stages, depends
        self._known: dict[bytes, tuple[np.ndarray, np.ndarray, bool]] = {}
        filed = stages.found("known_ways", Ways, depends)
        if filed is not None:
            self._learn(filed.a, filed.b, filed.clear)
        self._filed = time.monotonic()

    def __call__(self, fleet: Fleet, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """See `clear_ways`."""
        keys = [_key(*ends) for ends in zip(a, b, strict=True)]
        new = np.array([k for k, key in enumerate(keys) if key not in self._known], dtype=int)
        for rows in np.split(new, range(PART, len(new), PART)):
            if rows.size:
                self._learn(a[rows], b[rows], clear_ways(fleet, a[rows], b[rows]))
                self._file()
        return np.array([self._known[key][2] for key in keys], dtype=bool)

    def _learn(self, a: np.ndarray, b: np.ndarray, clear: np.ndarray) -> None:
        for start, end, good in zip(a, b, clear, strict=True):
            self._known[_key(start, end)] = (start, end, bool(good))

    def _file(self) -> None:
        if time.monotonic() - self._filed < OFTEN:
            return
        ways = Ways(*(np.array(column) for column in zip(*self._known.values(), strict=True)))
        self._stages.keep("known_ways", ways, self._depends)
        self._filed = time.monotonic()


def _key(a: np.ndarray, b: np.ndarray) -> bytes:
    return a.tobytes() + b.tobytes()
