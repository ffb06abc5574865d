"""`Estimate`: the answer of an estimation."""

from dataclasses import dataclass
from typing import Any

from gantrytau_optimica.estimation.parameter_fit import ParameterFit
from gantrytau_optimica.estimation.report import draw_fit, report_fit


@dataclass(frozen=True, eq=False, repr=False)
class Estimate(ParameterFit):
    """What `estimate` found. `fit.parameters["k"]` is a float in the model's unit; `.deviations`, `.covariance(names)` and
    `.intervals(0.95)` say how sure it is, `.residuals` and `.probability` how well model and data agree.
    """

    def report(self) -> str:
        """Parameters with deviations and intervals, correlations, fit and warnings."""
        return report_fit(self)

    def plot(self, file: Any = None):
        """Measured values and the model over time; returns the figure, and saves it to `file`."""
        return draw_fit(self, file)
