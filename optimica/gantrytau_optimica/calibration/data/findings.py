"""The error for measurements that cannot be used."""

from collections.abc import Sequence
from copy import copy
from typing import Any, Self, cast

import numpy as np

from gantrytau import GantryTauError
from gantrytau_optimica.fitting.finding import Finding, Part, in_lines


class CalibrationError(GantryTauError):
    """Measurements that determine no robot, or not this one.

    kind: the kind of the finding; rows: the rows concerned, from 0; findings: everything else that was noticed.
    """

    def __init__(
        self,
        *parts: Part,
        kind: str = "",
        rows: Sequence[int] | np.ndarray = (),
        findings: Sequence[Finding] = (),
        **facts: Any,
    ):
        super().__init__(*cast(Any, parts), **facts)
        self.kind = kind
        self.rows = np.asarray(rows, dtype=int)
        self.findings = tuple(findings)

    def in_lines(self, lines: np.ndarray) -> Self:
        """This finding with lines of a file, (N,) for all rows, in place of rows."""
        found = copy(self)
        found.parts = cast(Any, tuple(in_lines(self.parts, self.rows, lines)))
        return found
