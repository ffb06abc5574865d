"""Modes that follow from other modes: they are concluded, where those that hang on themselves are chosen."""

import casadi as ca
import numpy as np

from gantrytau.language.piecewise import Turn
from gantrytau.language.symbols import time
from gantrytau.simulation.events.margins import Switches


def test_modes_that_follow_from_others_are_concluded():
    x, z, t0, w = ca.SX.sym("x"), ca.SX.sym("z", 0), ca.SX.sym("t0"), ca.SX.sym("w", 4)
    moved, either, again, both = w.elements()
    turns = [
        Turn(moved, x - 1),
        Turn(either, moved + again - 0.5),
        Turn(again, either - 1.5),  # in the margin of one before it
        Turn(both, moved * either - 0.5),
    ]
    switches = Switches(turns, [x, z, time, t0, w], ca.SX(1), ca.SX(0, 1))
    assert switches.derived.tolist() == [False, True, False, True]
    modes = np.array([1.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(switches.concluded(modes, modes), [1, 1, 0, 1])
