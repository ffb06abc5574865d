"""Whether measurements are those of this robot: columns swapped, millimetres, turned frames, another robot.

Closure errors of nominal values are compared with those after each of a few mistakes is undone. Poses are thinned; the
median decides, so that outliers do not.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from gantrytau.kinematics.rotations import mean_rotation, motion
from gantrytau_optimica.calibration.data.findings import CalibrationError
from gantrytau_optimica.calibration.data.measurements import thinned
from gantrytau_optimica.calibration.data.mistakes import Mistake, mistakes
from gantrytau_optimica.calibration.links.arm_links import ArmLink
from gantrytau_optimica.calibration.links.closure import Chain
from gantrytau_optimica.calibration.links.error_models import ModelLink, moved
from gantrytau_optimica.calibration.links.linear_start import linear_start
from gantrytau_optimica.calibration.links.nominal_rods import NominalRods
from gantrytau_optimica.fitting.finding import Rows
from gantrytau_optimica.fitting.least_squares import least_squares

ROUGH = 1e-3  # m, of links by their linear equations, above which their closure is solved
NEAR = 0.1  # m by which nominal values may miss; a tape measure does better
BETTER = 10.0  # times smaller errors that undoing a mistake must leave
ALIKE = 0.05  # m; a D1 is within 75 mm of an L1 whose q2 and q3 are exchanged
TRIMMINGS = 8  # rounds of placing a frame without the points that fit it worst


# from q (N, n), r (N, 3), R to how far the worst link of each pose is from its length, (N,) in m
Misses = Callable[[np.ndarray, np.ndarray, np.ndarray | None], np.ndarray]


def check_robot(
    robot: NominalRods, misses: Misses, q: np.ndarray, r: np.ndarray, R: np.ndarray | None, rows: np.ndarray
) -> None:
    """CalibrationError if undoing a mistake makes nominal values fit that did not.

    misses: of nominal values; q (N, n), r (N, 3), R: measured; rows: their numbers for the message.
    """
    few = thinned(len(q))
    q, r, R = q[few], r[few], None if R is None else R[few]
    found = miss(misses, q, r, R)
    if found < NEAR / 10:
        return
    trials = [(m, miss(misses, *m.undo(q, r, R))) for m in mistakes_of(robot)]
    mistake, left = min(trials, key=lambda trial: trial[1])
    if left < NEAR and left * BETTER < found:
        raise CalibrationError(
            f"found {mistake.words} in ",
            Rows(rows),
            f" (links miss their lengths by {found * 1e3:.3g} mm in the median, {left * 1e3:.3g} mm with that undone); "
            "correct the columns of the measurements",
            kind=mistake.kind,
            rows=rows,
            place="Measurements",
        )


def mistakes_of(robot: NominalRods) -> Iterator[Mistake]:
    """Mistakes that can be made with measurements of this robot."""
    return mistakes(len(robot.arms), robot.turntables, robot.turns)


def explained_rows(
    robot: NominalRods, misses: Misses, limit: float, q: np.ndarray, r: np.ndarray, R: np.ndarray | None
) -> Iterator[tuple[Mistake, np.ndarray]]:
    """Mistakes that explain some of these rows: links close within `limit` once it is undone; places of these rows.

    First the mistake that explains most of them, of these the simplest: of a row with like numbers in two columns more
    than one is true.
    """
    found = misses(q, r, R)
    known = list(mistakes_of(robot))
    left = np.array([misses(*mistake.undo(q, r, R)) for mistake in known])
    good = (left < limit) & (left * BETTER < found)
    while good.any():
        best = min(
            range(len(known)),
            key=lambda k: (-good[k].sum(), known[k].words.count(","), left[k, good[k]].sum()),
        )
        places = np.flatnonzero(good[best])
        yield known[best], places
        good[:, places] = False


def miss(misses: Misses, q: np.ndarray, r: np.ndarray, R: np.ndarray | None) -> float:
    """How far links are from their nominal lengths, median over some of the poses of the worst link, m."""
    few = thinned(len(q))
    return float(np.median(misses(q[few], r[few], None if R is None else R[few])))


def swapped_carts(
    links: Sequence[ModelLink], off: float, q: np.ndarray, r: np.ndarray, R: np.ndarray | None
) -> tuple[str, float] | None:
    """What stands in the wrong columns, and by how much guideways are off then, m; None if no other order of the carts, nor
    a mirrored frame, brings guideways to their nominal places in any frame. off: m, by which they are off as it is.
    """
    count = q.shape[1]
    undone = [
        (
            ", ".join(f"q{k + 1} stands in column q{c + 1}" for k, c in enumerate(order) if k != c),
            q[:, order],
            r,
        )
        for order in permutations(range(count))
    ][1:]
    if all(link.chain.R is None for link in links):
        words = "x, y and z of a left-handed frame (one with the opposite sign, or two exchanged)"
        undone.append((words, q, -r))
    trials = []
    for words, carts, places in undone:
        fitting = compare(links, carts, places, R)
        there = misses_of(moved(links, fitting.turn, fitting.shift))
        trials.append((max(fitting.off, miss(there, carts, places, R)), words))  # by lengths too
    left, words = min(trials)
    return (words, left) if left < ALIKE and left * BETTER < off else None


def misses_of(links: Sequence[ModelLink]) -> Misses:
    """How far links are from their start lengths."""
    arms = {id(link.chain.poses): link.chain.poses.arm for link in links if isinstance(link.chain, ArmLink)}
    straight = [(link.chain, link.start) for link in links if isinstance(link.chain, Chain)]

    def misses(q: np.ndarray, r: np.ndarray, R: np.ndarray | None) -> np.ndarray:
        errors = [np.abs(chain.over(q, r, R).gap(start)) for chain, start in straight]
        errors += [np.abs(arm.errors(q, r, R)).max(axis=1) for arm in arms.values()]
        return np.max(errors, axis=0)

    return misses


@dataclass(frozen=True)
class Fitting:
    """How nominal values fit measurements.

    miss: of the links, in the frame of the measurements, m; left: of links that are identified without nominal values, m;
    turn (3, 3), shift (3,) in m: from the frame of nominal values to that of the measurements, as well as that can be;
    off: of guideways after this motion, m.
    """

    miss: float
    left: float
    turn: np.ndarray
    shift: np.ndarray
    off: float


def compare(links: Sequence[ModelLink], q: np.ndarray, r: np.ndarray, R: np.ndarray | None) -> Fitting:
    """Nominal values beside measurements: in their frame, and in the frame that suits them best."""
    few = thinned(len(q), 1000)
    q, r, R = q[few], r[few], None if R is None else R[few]
    nominal, found, left = [], [], []
    middle = q.mean(axis=0)
    for link in links:
        chain = Chain("", link.cart, q[:, link.cart], r)
        x = linear_start(chain)
        off = _left(chain, x)
        if off > ROUGH:  # noise of millimetres in all of the equations bends what is linear in them
            closed = least_squares(chain.error, chain.jacobian, x).x
            x = closed if _left(chain, closed) < off else x
        left.append(_left(chain, x))
        # a joint on the plate moves the guideway that is found, in the axes of the measurements
        lever = np.zeros(3) if link.chain.R is None or R is None else mean_rotation(R) @ link.start[7:10]
        for s in (-1.0, 1.0):  # two points of the guideway
            nominal.append(link.start[1:4] + (middle[link.cart] + s) * link.start[4:7])
            found.append(x[1:4] + lever + (middle[link.cart] + s) * x[4:7])
    a, b = np.array(nominal), np.array(found)
    turn, shift = motion(a, b)
    off = np.linalg.norm(b - shift - a @ turn.T, axis=1).max()
    return Fitting(miss(misses_of(links), q, r, R), float(max(left)), turn, shift, float(off))


def _left(chain: Chain, x: np.ndarray) -> float:
    """How far a link is from the length of numbers x, median in m."""
    return float(np.median(np.abs(chain.gap(x))))


def trimmed_motion(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What `motion` says of the better two thirds of the points, as of poses among which there are outliers."""
    good = np.isfinite(a).all(axis=1) & np.isfinite(b).all(axis=1)
    a, b = a[good], b[good]
    kept = np.arange(len(a))
    for _ in range(TRIMMINGS):
        turn, shift = motion(a[kept], b[kept])
        kept = np.argsort(np.linalg.norm(b - shift - a @ turn.T, axis=1))[: max(3, 2 * len(a) // 3)]
    return motion(a[kept], b[kept])
