"""What is doubtful about a reconstruction: spacing of other rows, lenses of other cameras, plates that turn."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from gantrytau import GantryTauError
from gantrytau.kinematics.rotations import angle_between
from gantrytau_optimica.fitting.finding import Finding, rows_in_words
from gantrytau_optimica.vision.opencv import VisionError
from gantrytau_optimica.vision.reconstruction.adjustment import LEAST_SIGMA, adjusted, started
from gantrytau_optimica.vision.reconstruction.bundle import PRIOR, Bundle, State
from gantrytau_optimica.vision.reconstruction.spacing import Spacing

Array = np.ndarray
OFF = 0.1  # of distances along the guideways, by which places may miss them before lenses are known
ANOTHER_SIZE = 1.25  # times the side of the pattern, beyond which spacing and side contradict each other
SIZE_TOLD = 0.01  # of the side of the pattern, by which spacing must say it is another to be told
CONTRADICTED = 0.05  # of the side, by which spacing must say it is another to be believed alone
LARGE = 0.3  # pixel, of what is left of image points, above which reasons are looked for
REFUSED, NOISY = 1.0, 3.0  # pixel, and deviations of a corner, above which images do not belong together
CLEARLY = 0.93  # of what is left, below which what is held is better let go: noise gains 2 % by it
BETTER = 0.6  # of what is left, below which a reason explains it
TILT = np.radians(0.5)  # from which on a pose is told to be turned
LEARNT = 0.35  # of the deviation that is assumed of what was given, above which images do not tell a lens
NUMBERS = ("the focal length", "the centre across", "the centre down", "k1")


def check_spacing(spacing: Spacing, r: Array, rows: Array) -> float:
    """How large the pattern is by spacing, as a multiple of its side; VisionError where places (N, 3) in m, by that side, do
    not move as spacing says. rows: of all poses.
    """
    missed = _missed(spacing, r)
    if missed > OFF:
        trials = {
            shift: _missed(_shifted(spacing, shift), r) for shift in (-1, 1) if _shifted(spacing, shift).lines
        }
        best = min(trials, key=lambda shift: trials[shift], default=0)
        cause = "check that rows of spacing are those of the images, in the same order"
        if best and trials[best] < BETTER * missed:
            ahead = "one row later" if best > 0 else "one row earlier"
            cause = f"with each row of spacing {ahead} it is {100 * trials[best]:.3g} %; images and carts are shifted by one"
        raise VisionError(
            f"reconstruct: places of {rows_in_words(rows[spacing.line >= 0])} miss the spacing along the guideways by "
            f"{100 * missed:.3g} % of its extent (rms), expected below {100 * OFF:g} %; {cause}"
        )
    size = 1 / float(np.linalg.norm(spacing.displaced(r)))
    if not 1 / ANOTHER_SIZE < size < ANOTHER_SIZE:
        raise VisionError(
            f"reconstruct: by spacing the pattern is {size:.4g} times as large as its side says, expected about 1; "
            "spacing and side are in m: divide mm by 1000"
        )
    return size


def check_left(bundle: Bundle, state: State, sigma: float) -> None:
    """VisionError where images do not belong together, with what would explain it; sigma: of a corner in pixels."""
    left, expected = left_over(bundle, state), max(REFUSED, NOISY * sigma)
    if left <= expected:
        return
    trials = [*_freed(bundle, state), *_exchanged(bundle)]
    reasons = "; ".join(words for words, other in trials if other < BETTER * left)
    raise VisionError(
        f"reconstruct: image points miss by {left:.3g} pixel in the median, expected below {expected:.2g}; "
        f"{reasons or 'check the lenses, the side, and that images of all cameras are of the same poses'}"
    )


def suspected(
    bundle: Bundle, state: State, size: float, rows: Array, lens_deviations: Array
) -> list[Finding]:
    """Findings on a reconstruction, rows from 0 of all poses. size: of the pattern as a multiple of its side."""
    found = []
    if abs(size - 1) > SIZE_TOLD:
        words = f"by spacing the pattern is {100 * (size - 1):+.2g} % larger than its side says; measure both"
        more = "; lengths are those of spacing" if abs(size - 1) > CONTRADICTED else ""
        found.append(Finding("size", rows, words + more))
    left = left_over(bundle, state)
    trials = [(CLEARLY, *trial) for trial in _freed(bundle, state)] if left > LEAST_SIGMA else []
    trials += [(BETTER, *trial) for trial in _exchanged(bundle)] if left > LARGE else []
    missed = f"image points miss by {left:.3g} pixel in the median"
    found += [
        Finding("images", rows, f"{missed}; {words}")
        for share, words, other in trials
        if other < share * left
    ]
    for c, deviations in enumerate(lens_deviations):
        known = deviations[: len(NUMBERS)] / PRIOR[: len(NUMBERS)]
        vague = [name for name, part in zip(NUMBERS, known, strict=True) if part > LEARNT]
        if vague:
            words = f"camera {c + 1}: images tell {', '.join(vague)} hardly better than was assumed of what is given; take "
            found.append(Finding("lens", rows, f"{words}poses all over the image, or intrinsics='fixed'"))
    return found


def _freed(bundle: Bundle, state: State) -> Iterator[tuple[str, float]]:
    """What is held and would not stay where it is held, and what would be left of image points, median in pixels."""
    yield from _turning(bundle, state)
    told = bundle.told
    if told.plate and not told.lenses:
        estimated = replace(bundle, told=replace(told, lenses=True))
        _, bent, _, _ = adjusted(estimated, state)
        left = left_over(estimated, bent)
        k1 = ", ".join(f"{camera.distortion[0]:.3f}" for camera in bent.cameras)
        words = f"with k1 {k1} they would by {left:.3g}: lenses are not those given"
        yield f"{words}; intrinsics='estimate' finds them", left


def _exchanged(bundle: Bundle) -> Iterator[tuple[str, float]]:
    """Images and lenses in another order, and what would be left of image points, median in pixels."""
    if len(bundle.given) != 2:
        return
    plain = replace(bundle, told=replace(bundle.told, spacing=None, sized=False))
    trials = [
        (
            "lenses are swapped: give them in the order of the images",
            replace(plain, given=bundle.given[::-1]),
        ),
        ("images of camera 2 are one pose late: leave out its first", _late(plain, 1)),
        ("images of camera 2 are one pose early: leave out the first of camera 1", _late(plain, 0)),
    ]
    for words, trial in trials:
        try:
            trial, fitted, _, _ = adjusted(trial, started(trial))
        except (GantryTauError, np.linalg.LinAlgError):
            continue
        yield words, left_over(trial, fitted)


def _late(bundle: Bundle, which: int) -> Bundle:
    """The bundle without the first image of one of two cameras, later ones paired anew."""
    rows = [slice(1, None) if c == which else slice(None, -1) for c in (0, 1)]
    pixels = np.stack([each[row] for each, row in zip(bundle.pixels, rows, strict=True)])
    return replace(bundle, pixels=pixels, weights=bundle.weights[:, :-1])


def _turning(bundle: Bundle, state: State) -> Iterator[tuple[str, float]]:
    """Whether plates turn that are taken for turned alike."""
    told = bundle.told
    if not (told.plate and told.alike):
        return
    free = replace(bundle, told=replace(told, alike=False))
    _, turned, _, _ = adjusted(free, state)
    angles = angle_between(turned.R, np.broadcast_to(state.R[0], turned.R.shape))
    rows = np.flatnonzero(angles > TILT)
    if rows.size:
        words = (
            f"plates turn by up to {np.degrees(angles.max()):.3g} deg ({rows_in_words(rows)} of those found)"
        )
        yield f"{words}; orientation='free' lets them", left_over(free, turned)


def left_over(bundle: Bundle, state: State) -> float:
    """What is left of image points, median in pixels."""
    return float(np.nanmedian(np.linalg.norm(bundle.residuals(state), axis=-1)))


def _missed(spacing: Spacing, r: Array) -> float:
    """By how much places miss the spacing along the guideways, as a part of its extent, rms."""
    known = spacing.line >= 0
    moved = spacing.displaced(r)
    size = float(np.linalg.norm(moved))
    if not size > 0:
        return np.inf
    line, x = spacing.line[known], spacing.x[known]
    count = np.bincount(line)
    along = r[known] @ moved / size**2
    off = along - x
    off, x = (each - (np.bincount(line, each) / count)[line] for each in (off, x))
    return float(np.sqrt(np.mean(off**2) / np.mean(x**2)))


def _shifted(spacing: Spacing, rows: int) -> Spacing:
    """Spacing whose rows stand so many rows later."""
    x, line = np.roll(spacing.x, rows), np.roll(spacing.line, rows)
    edge = slice(None, rows) if rows > 0 else slice(rows, None)
    x[edge], line[edge] = np.nan, -1
    return Spacing(x, line).select(np.arange(len(x)))
