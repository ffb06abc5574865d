"""The chosen poses in a collision-free order; what cannot be reached is replaced by the next best."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gantrytau import ModelError
from gantrytau_optimica.calibration.devices.devices import Device
from gantrytau_optimica.procedure.candidates import Candidates
from gantrytau_optimica.procedure.motion_planning.clear_ways import clear_ways
from gantrytau_optimica.procedure.motion_planning.tours import PLACES, Roadmap, find_tour, spread
from gantrytau_optimica.procedure.plan_goal import PlanGoal
from gantrytau_optimica.procedure.pose_choice import PoseChoice, choose
from gantrytau_optimica.procedure.robot_samples import Fleet

ROUNDS = 10  # of choosing anew without what cannot be reached


@dataclass(frozen=True, eq=False)
class Order:
    """The program: q (k, n) from home to home; measured: (k,) at which the device measures.

    rows: of the candidates that are measured; lost: rows (m,) of candidates that were chosen but cannot be reached.
    """

    q: np.ndarray
    measured: np.ndarray
    rows: np.ndarray
    lost: np.ndarray


def ordered(
    fleet: Fleet,
    candidates: Candidates,
    device: Device,
    choice: PoseChoice,
    asked: PlanGoal,
    check: Callable[..., np.ndarray] = clear_ways,
) -> Order:
    """An order of the chosen poses with clear ways, from home and back; poses that have none are replaced.

    check: which ways are clear, as `clear_ways` says it. Raises ModelError where no pose at all can be reached.
    """
    safe = candidates.safe
    allowed = candidates.usable
    few = safe[spread(candidates.q[safe], PLACES)]
    rows, lost = choice.rows, []
    places = np.union1d(few, rows)
    roadmap = Roadmap(fleet, np.concatenate([asked.home[None], candidates.q[places]]), check)
    tour = find_tour(roadmap, 1 + np.searchsorted(places, rows))
    for _ in range(ROUNDS):
        lost += places[tour.lost - 1].tolist()
        allowed = np.setdiff1d(allowed, [*lost, *_apart(roadmap, places, candidates, allowed)])
        if not len(tour.lost) or not len(allowed):
            break
        rows = choose(fleet, candidates, device, allowed, asked).rows
        places, roadmap = _extended(roadmap, places, rows, candidates)
        tour = find_tour(roadmap, 1 + np.searchsorted(places, rows))
    lost += places[tour.lost - 1].tolist()
    stops = tour.nodes[(~tour.via) & (tour.nodes > 0)]
    if not len(stops):
        raise ModelError(
            f"plan_calibration.home: found no clear way from home to any of {len(choice.rows)} chosen poses, which all "
            "robots within twice the tape error could go; expected one; take a home in the free space where the poses are, "
            "smaller margins, or give smaller obstacles",
            argument="home",
        )
    q = roadmap.q[tour.nodes]
    return Order(q, ~tour.via & (tour.nodes > 0), places[stops - 1], np.array(sorted(set(lost)), dtype=int))


def _apart(roadmap: Roadmap, places: np.ndarray, candidates: Candidates, allowed: np.ndarray) -> np.ndarray:
    """Rows of allowed candidates whose nearest place of the roadmap is known to have no way from home."""
    from scipy.spatial import KDTree

    reached = roadmap.connected(0)[1:]
    if reached.all():
        return np.zeros(0, dtype=int)
    nearest = KDTree(candidates.q[places]).query(candidates.q[allowed])[1]
    return allowed[~reached[nearest]]


def _extended(
    roadmap: Roadmap, places: np.ndarray, rows: np.ndarray, candidates: Candidates
) -> tuple[np.ndarray, Roadmap]:
    """The roadmap with more places, which keeps what it knows."""
    more = np.union1d(places, rows)
    if len(more) == len(places):
        return places, roadmap
    found = roadmap.among(np.concatenate([roadmap.q[:1], candidates.q[more]]))
    where = np.concatenate([[0], 1 + np.searchsorted(more, places)])
    found.learn({(int(where[i]), int(where[j])): clear for (i, j), clear in roadmap.known.items()})
    return more, found
