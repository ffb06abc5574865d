"""Table 6.3 of Dressler (2012): which model leaves the least of the same motion."""

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import compare, printed_models
from tests.optimica.identification import gantry_logs as logs

COULOMB = np.array([[189.12, 145.69], [262.59, 119.23], [239.06, 177.22]])  # N, Table 6.1
VISCOUS = np.array([[205.03, 158.01], [190.00, 133.76], [185.94, 197.52]])  # kg/s


def test_the_models_of_the_thesis_rank_as_printed():
    """A plant with Stribeck, asymmetric, load-dependent friction and cogging, whose friction had changed since Table 6.1."""
    models = printed_models(COULOMB, VISCOUS)
    tables = [compare(GantryTau(prototypes.L1), logs.log(seed, logs.REAL), models) for seed in range(20)]
    assert [table.ranking for table in tables].count(("2", "4", "1", "3")) >= 19
    assert "sum of squares" in str(tables[0])
    assert tables[0].fits["2"].robot is not None


def test_no_models_are_refused():
    with pytest.raises(ModelError, match="found no models, expected keywords of identify by name"):
        compare(GantryTau(prototypes.L1), logs.log(0), {})
