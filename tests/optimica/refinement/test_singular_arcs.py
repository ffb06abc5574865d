"""Borders where singular arcs end, and an interrupt while they are sought."""

import numpy as np
import pytest

from gantrytau import SolveError
from gantrytau_optimica import optimize
from gantrytau_optimica.refinement import refinement
from gantrytau_optimica.refinement.singular_arcs import with_borders_at
from gantrytau_optimica.transcription.mesh import Mesh
from tests.optimica.known_answers.test_singular import Goddard


@pytest.mark.parametrize("end", [0.0, 1e-13, 0.3 + 1e-13, 0.301, 0.999, 1.0])
def test_borders_at_ends_of_arcs_leave_no_short_elements(end):
    tenths = Mesh(np.linspace(0.0, 1.0, 11))
    assert np.min(with_borders_at([("u", end, 0.55)], tenths).widths) > 0.04


def test_an_interrupt_at_the_ends_of_arcs_leaves_the_answer_that_holds(monkeypatch):
    def pressed(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(refinement, "_with_sharp_ends", pressed)
    with pytest.raises(SolveError) as error:
        optimize(Goddard, elements=20, refine=1e-6)
    assert error.value.optimum.refinement.reached
