"""Signals of an optimum differentiated along a direction of its unknowns."""

from collections.abc import Sequence

import casadi as ca
import numpy as np

from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.transcription.layout import Layout, Track


class Movement:
    """Variables of one phase, differentiated along a direction of the unknowns at fixed times.

    y = e(t, s(place), p), place = ((t - t0) / (t1 - t0) - left) / width of the element
    dy = e_s (ds at its place + s' dplace) + e_p dp
    """

    def __init__(self, optimum: Optimum, elements: Sequence[str], direction: np.ndarray):
        self.trajectory = optimum.phases[optimum.path_of(elements[0])]
        self.direction = direction
        problem, phase = optimum.program.problem, self.trajectory.phase
        self.numbers = direction[optimum.program.places.free]
        signals = ca.vertcat(ca.SX(0, 1), *(s.symbol for s in phase.signals))
        courses = ca.vertcat(ca.SX(0, 1), *(c.symbol for c in phase.courses))
        moved, shifted = ca.SX.sym("moved", signals.numel()), ca.SX.sym("shifted", problem.numbers.numel())
        both, seeds = ca.vertcat(signals, problem.numbers), ca.vertcat(moved, shifted)
        change = ca.jtimes(optimum.built.expressed(elements), both, seeds)
        self.change = ca.Function(
            "change", [problem.time, signals, courses, problem.numbers, moved, shifted], [ca.densify(change)]
        )
        ends = ca.vertcat(phase.start_time, phase.final_time)
        ends = ca.Function("ends", [problem.numbers, shifted], [ca.jtimes(ends, problem.numbers, shifted)])
        self.ends = np.array(ends(self.trajectory.numbers, self.numbers)).ravel()

    def at(self, times: np.ndarray) -> np.ndarray:
        """The derivatives (k, n) at times (n,)."""
        trajectory, layout = self.trajectory, self.trajectory.layout
        span = trajectory.final_time - trajectory.start_time
        share = (times - trajectory.start_time) / span
        element, place = trajectory.mesh.locate(share)
        shift = self._shift(np.clip(share, 0.0, 1.0), element, place, span)
        moved = [
            track.values(self.direction, element, place) + shift * _rate(track, trajectory.w, element, place)
            for track in layout.tracks
        ]
        values = trajectory.at(element, place, times)
        count, n = len(layout.tracks), times.size
        numbers = [np.tile(part[:, None], n) for part in (trajectory.numbers, self.numbers)]
        moved = np.array(moved).reshape(-1, n)
        return np.array(
            self.change(times[None, :], values[:count], values[count:], numbers[0], moved, numbers[1])
        )

    def _shift(self, share: np.ndarray, element: np.ndarray, place: np.ndarray, span: float) -> np.ndarray:
        """How fast the place of a fixed time moves through its element."""
        mesh, layout = self.trajectory.mesh, self.trajectory.layout
        moved = -(self.ends[0] + share * (self.ends[1] - self.ends[0])) / span
        borders = _borders(layout, self.direction)
        left, right = borders[element], borders[element + 1]
        return (moved - left - place * (right - left)) / mesh.widths[element]


def _borders(layout: Layout, direction: np.ndarray) -> np.ndarray:
    """How fast the borders of the elements move, (n + 1,)."""
    if not layout.knots.size:
        return np.zeros(layout.mesh.elements + 1)
    return layout.mesh.shares()[0] @ direction[layout.knots]


def _rate(track: Track, w: np.ndarray, element: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Derivative of a signal with respect to the place in its element, (n,)."""
    nodes = track.nodes[element]
    found = np.zeros(nodes.shape)
    for j in range(nodes.shape[1]):
        others = [i for i in range(nodes.shape[1]) if i != j]
        for left_out in others:
            factor = 1 / (nodes[:, j] - nodes[:, left_out])
            for i in others:
                if i != left_out:
                    factor = factor * (place - nodes[:, i]) / (nodes[:, j] - nodes[:, i])
            found[:, j] += factor
    return np.einsum("km,km->k", found, w[track.unknowns[element]])
