"""The error for measurements that cannot be used."""

from collections.abc import Sequence

import numpy as np

from gantrytau import GantryTauError
from gantrytau_optimica.fitting.finding import Finding


class CalibrationError(GantryTauError):
    """Measurements that determine no robot, or not this one.

    kind: the kind of the finding; rows: the rows concerned, from 0; findings: everything else that was noticed.
    """

    def __init__(self, message: str, *, kind: str = "", rows: Sequence[int] | np.ndarray = (), findings=()):
        super().__init__(message)
        self.kind = kind
        self.rows = np.asarray(rows, dtype=int)
        self.findings: tuple[Finding, ...] = tuple(findings)
