"""Whether what is left of a fit is noise: tests of the closure errors of each link."""

from collections.abc import Iterable
from typing import Any

import numpy as np


def residual_tests(link_errors: Iterable[tuple[str, np.ndarray, np.ndarray]]) -> list[dict[str, Any]]:
    """Tests of the closure errors of fitted poses, in the order measured, for each link: its name, positions of its cart and
    errors, (N,) each.

    normal: skewness and kurtosis (D'Agostino and Pearson, 1973); neighbours: correlation of one pose with the next;
    along the guideway: share of the errors that a polynomial of the eighth degree in q explains (F test), as bends of a
    guideway do. probability: that noise alone gives as large a value; a small one points to an error of the model.
    """
    tests = []
    for link, q, e in link_errors:
        if len(e) < 20:  # what the tests of normality need
            continue
        for name, value, probability in (_normal(e), _neighbours(e), _along(e, q)):
            tests.append({"link": link, "test": name, "value": value, "probability": probability})
    return sorted(tests, key=lambda test: test["link"])


def _normal(e: np.ndarray) -> tuple[str, float, float]:
    from scipy import stats

    found = stats.normaltest(e)
    return "normal", float(found.statistic), float(found.pvalue)


def _neighbours(e: np.ndarray) -> tuple[str, float, float]:
    from scipy import stats

    e = e - e.mean()
    total = float(e @ e)
    correlation = float(e[1:] @ e[:-1]) / total if total > 0 else 0.0
    return "neighbours", correlation, float(2 * stats.norm.sf(abs(correlation) * np.sqrt(len(e))))


def _along(e: np.ndarray, q: np.ndarray) -> tuple[str, float, float]:
    from scipy import stats

    degree = 8
    e, span = e - e.mean(), float(np.ptp(q))
    if span == 0.0:
        return "along the guideway", 0.0, 1.0
    design = np.polynomial.chebyshev.chebvander(2 * (q - q.min()) / span - 1, degree)
    left = e - design @ np.linalg.lstsq(design, e, rcond=None)[0]
    total, rest, freedom = float(e @ e), float(left @ left), len(e) - degree - 1
    share = 1 - rest / total if total > 0 else 0.0
    ratio = share / degree / max((1 - share) / freedom, 1e-300)
    return "along the guideway", share, float(stats.f.sf(ratio, degree, freedom))
