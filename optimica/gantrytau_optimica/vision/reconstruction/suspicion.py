"""What is doubtful about a reconstruction: shifted rows, another plate, plates that turn, cameras that are swapped."""

from dataclasses import replace
from typing import Any

import numpy as np

from gantrytau_optimica.calibration.data.findings import Finding
from gantrytau_optimica.vision.detection.detections import Detections
from gantrytau_optimica.vision.reconstruction.bundle import PRIOR, Bundle, State
from gantrytau_optimica.vision.reconstruction.reconstruction import Reconstruction

Array = np.ndarray


def suspected(
    bundle: Bundle, state: State, found: Reconstruction, rows: Array, detections: Detections, spacing: Any
) -> list[Finding]:
    """Findings on a reconstruction, rows from 0 of all poses."""
    return []
