"""Where Ipopt has no gradient to go by although there is something better: maxima, saddles, and obstacles met head-on.

What a first guess holds at a place of symmetry has no gradient there and never moves; only curvature tells it. A solution
is looked at where Ipopt's last steps were regularised, or where there were none: else the matrix of its steps had as many
negative eigenvalues as there are conditions, which is what makes a solution of the barrier problem a minimum:
Waechter and Biegler (2006), On the implementation of an interior-point filter line-search algorithm, section 3.1.
"""

from collections.abc import Iterator

import numpy as np

from gantrytau_optimica.solving.curvature import falls_somewhere, least_curvature
from gantrytau_optimica.solving.ipopt import Solution
from gantrytau_optimica.transcription.assemble import scipy_matrix
from gantrytau_optimica.transcription.program import Program

ASIDE = 0.1  # of its size: how far what moves most along the direction is moved
FARTHER = (1.0, -1.0, 10.0)  # times that, one after the other, until the objective is less there
VIOLATED = 1e-6  # of its size: by how much a limit is passed
LEVEL = 1e-9  # derivatives less than this vanish
BENT = 1e-6  # curvatures less than this do


def places_aside(program: Program, solution: Solution) -> Iterator[np.ndarray]:
    """Unknowns to go on from beside a solution that is a maximum or a saddle; none where it is a minimum."""
    if solution.upright or not falls_somewhere(program, solution):
        return
    found = least_curvature(program, solution)
    if not found.falls or found.direction is None:
        return
    scale = program.places.scale
    for far in FARTHER:
        beside = solution.w / scale + far * ASIDE * found.direction
        yield np.clip(beside, program.lbw, program.ubw) * scale


def aside(program: Program, first: np.ndarray, far: float) -> np.ndarray:
    """A first guess (n,) with its signals bent by parts `far` of their sizes, each with a phase of its own, off symmetry:
    beside a turn about one axis other axes have a gradient.
    """
    w, scale = first.copy(), program.places.scale
    for layout in program.places.layouts:
        for number in range(len(layout.phase.signals)):
            mine = layout.of(number)
            share = np.pi * layout.moment[mine - layout.first]
            w[mine] += far * scale[mine] * np.sin(share) * np.cos(number + share)
    return np.clip(w / scale, program.lbw, program.ubw) * scale


def beside_obstacles(program: Program, first: np.ndarray) -> np.ndarray:
    """A first guess (n,) that passes limits without a gradient to either side, moved to one side of them.

    A way straight through the middle of an obstacle is violated least there, to first order: d V / d w = 0 and
    d2 V / d w2 < 0, V: sum of what is violated.
    """
    scale, assembled = program.places.scale, program.assembled
    x = first / scale
    g = np.array(assembled.nlp(x, [])[1]).ravel()
    passed = np.where(g > program.ubg + VIOLATED, 1.0, np.where(g < program.lbg - VIOLATED, -1.0, 0.0))
    passed[program.lbg == program.ubg] = 0.0
    if not np.any(passed):
        return first
    jacobian = abs(scipy_matrix(assembled.jac_g(x, [])[1]).tocsr()[np.flatnonzero(passed)])
    steepest = jacobian.max(axis=0).toarray().ravel()
    if not np.any(steepest[jacobian.indices] <= LEVEL):
        return first
    bent = scipy_matrix(assembled.hess_lag(x, [], 0.0, passed)).diagonal()
    aside = (steepest <= LEVEL) & (bent < -BENT)
    return np.clip(np.where(aside, x + ASIDE, x), program.lbw, program.ubw) * scale
