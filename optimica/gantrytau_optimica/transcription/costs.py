"""What is summed into the objective: integrals, penalties on steps, and errors at samples."""

from collections.abc import Iterator

import casadi as ca
import numpy as np
from scipy import sparse

from gantrytau import ModelError
from gantrytau.border.refusal import Given
from gantrytau_optimica.control.control_problem import ControlProblem, SampleSum
from gantrytau_optimica.transcription.assemble import Term
from gantrytau_optimica.transcription.layout import Layout, Places, Sparse
from gantrytau_optimica.transcription.point_functions import running

Known = tuple[tuple[ca.SX, ca.SX], np.ndarray]  # symbols, and their values (2, N)


def running_costs(places: Places, layout: Layout) -> list[Term]:
    """The integral of the integrand, and the penalties on steps of piecewise inputs."""
    found, phase = [], layout.phase
    if not phase.integrand.is_zero():
        run = running(places, layout)
        weights = np.tile(layout.scheme.weights, layout.mesh.elements)[None, :]
        element, place = layout.points
        found.append(
            run.term(phase.integrand * run.horizon * run.width, element, place, sparse.csr_matrix(weights))
        )
    for signal, chain in layout.chains.items():
        pieces, size = phase.signals[signal].pieces, places.scale[chain[0]]
        if pieces.step_penalty and chain.size > 1:
            step = ca.SX.sym("step")
            weights = np.full((1, chain.size - 1), pieces.step_penalty * size**2)
            found.append(
                Term(
                    step,
                    ca.SX(0, 1),
                    ca.SX(0, 1),
                    step**2,
                    np.zeros((0, chain.size - 1)),
                    differences(places, chain),
                    sparse.csr_matrix(weights),
                )
            )
    return found


def without_sums(problem: ControlProblem) -> ca.SX:
    """The objective less its sums over samples, which have terms of their own."""
    symbols = list({s.symbol.element_hash(): s.symbol for s in problem.sums}.values())
    return (
        ca.substitute(problem.objective, ca.vertcat(*symbols), ca.SX.zeros(len(symbols), 1))
        if symbols
        else problem.objective
    )


def sample_sums(places: Places, layout: Layout) -> list[Term]:
    """The sums over samples of a phase, a small function at every sample. Raises ModelError where borders move."""
    problem, found = places.problem, []
    if layout.phase.sums and layout.knots.size:
        why = "expected 'given' beside sums over samples; give the lengths of the elements"
        raise ModelError(why, place=problem.name, found=Given("lengths", "free"))
    for one, error, element, place, known in sample_errors(layout):
        weight = float(ca.jacobian(problem.objective, one.symbol))
        weights = sparse.csr_matrix(np.full((1, one.times.size), weight))
        found.append(running(places, layout).term(error**2, element, place, weights, extra=known))
    return found


def sample_errors(layout: Layout) -> Iterator[tuple[SampleSum, ca.SX, np.ndarray, np.ndarray, Known]]:
    """For every sum over samples of a phase (model - measured) / deviation, element and place of all its samples, and
    symbols and values of measured and deviation there.
    """
    for one in layout.phase.sums:
        start, final = float(layout.phase.start_time), float(layout.phase.final_time)
        element, place = layout.mesh.locate((one.times - start) / (final - start))
        # at a jump what holds from then on counts
        after = (place > 1 - 1e-9) & (element < layout.mesh.elements - 1)
        element, place = np.where(after, element + 1, element), np.where(after, 0.0, place)
        value, deviation = ca.SX.sym("value"), ca.SX.sym("deviation")
        error = (one.expression - value) / deviation
        yield one, error, element, place, ((value, deviation), np.vstack([one.values, one.deviations]))


def differences(places: Places, chain: np.ndarray) -> Sparse:
    """Steps between consecutive unknowns, divided by their size."""
    rows = np.arange(chain.size - 1)
    size = places.scale[chain[0]]
    return places.pick(
        [rows, rows], [chain[1:], chain[:-1]], [np.full(rows.size, v / size) for v in (1.0, -1.0)], rows.size
    )
