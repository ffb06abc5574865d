"""All ways to assemble six links: the forward kinematics of a general hexapod without a start value.

|r + R B_k - A_k| = L_k, k = 1..6: Dressler (2012), (4.34), has 40 solutions in complex poses, of which the real ones
are the assembly modes. All of them are found, by following those of a known hexapod (study*.py).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gantrytau.describing.record import Record
from gantrytau.kinematics.modes.hexapod_checks import checked_hexapod, specialities
from gantrytau.kinematics.modes.link_crossings import PAIRS, link_geometry, sides, signs
from gantrytau.kinematics.modes.study_coordinates import pose
from gantrytau.kinematics.modes.study_poses import ExactPoses, exact_poses, link_errors
from gantrytau.kinematics.modes.study_roots import MODES, Roots, all_roots, placed

REAL = 1e-6  # imaginary part of z of length 1: a complex pair nearer to each other than that counts as real
REAL_SINGULAR = 1e-5  # the same of singular modes, which are known less well


@dataclass(frozen=True, eq=False)
class AssemblyModes(Record):
    """The modes of a hexapod: real ones first, those of one group together; complex ones in conjugate pairs.

    r: (k, 3), position of the platform, in m; R: (k, 3, 3), its rotation; complex both, real ones without
    imaginary part. real, regular: (k,); singular modes, in which several meet or the links do not hold the
    platform, are known to some 1e-6 only. complete: all 40 modes were found. error: (k,), error of the link lengths, in m:
    rounding, of real modes some 1e-16, of complex ones far away 1e-16 |r|^2 / L; `exact` has the same modes with `.r .R
    .error` in the longest numbers of the machine (np.clongdouble), on x86 with 1e-12 m up to some 500 m away.
    feasible: (k,), real, no links crossed, links `diameter` apart; crossed: pairs of links per mode; clearance:
    (k,), least distance of two links, in m, NaN for complex modes. group: (k,), 1 or -1, side of the plane
    through the base joints, 0 for complex modes; the largest component of its normal is positive. sign: (k,), 1 or
    -1: between modes of different signs lies a singular pose; 0 for complex modes. findings: special cases met.
    """

    r: np.ndarray
    R: np.ndarray
    real: np.ndarray
    regular: np.ndarray
    complete: bool
    error: np.ndarray
    exact: ExactPoses
    feasible: np.ndarray
    crossed: tuple[tuple[tuple[int, int], ...], ...]
    clearance: np.ndarray
    group: np.ndarray
    sign: np.ndarray
    findings: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.r)

    @property
    def poses(self) -> tuple[np.ndarray, np.ndarray]:
        """The real modes as real arrays, r (m, 3) and R (m, 3, 3), in the order of the record."""
        return np.real(self.r[self.real]), np.real(self.R[self.real])

    def __str__(self) -> str:
        lines = [
            f"{len(self)} assembly modes, {self.real.sum()} real, {self.feasible.sum()} without crossed links"
        ]
        for k in np.flatnonzero(self.real):
            place = ", ".join(f"{x:.4f}" for x in self.r[k].real)
            pairs = ", ".join(f"{i}-{j}" for i, j in self.crossed[k])
            crossed = f", links {pairs} crossed" if pairs else ""
            lines.append(f"  r = ({place}) m, group {self.group[k]:+d}, sign {self.sign[k]:+d}{crossed}")
        return "\n".join([*lines, *self.findings])


def assembly_modes(
    base: Sequence | np.ndarray,
    platform: Sequence | np.ndarray,
    lengths: Sequence | np.ndarray,
    *,
    diameter: float = 0.0,
) -> AssemblyModes:
    """All poses in which six links of given lengths join a platform to its base, complex ones included.

    base: joints in the world, (6, 3); platform: joints in its own axes, (6, 3); lengths: (6,); diameter: of the
    links, which makes modes feasible; all in m. Raises ModelError for other shapes and values, StructureError where the
    modes of the hexapod are no separate poses: joints on one line, or links whose conditions repeat each other.
    """
    base, platform, lengths = checked_hexapod(base, platform, lengths, diameter)
    *normal, size = placed(base, platform, lengths)
    roots = all_roots(*normal)
    z, real = _real_ones(roots)
    exact = _exact(z, roots.regular, base, platform, lengths, size)
    order = _order(exact.r.astype(complex), real, base, platform, exact.R.astype(complex))
    exact, real, regular = ExactPoses(*(a[order] for a in exact)), real[order], roots.regular[order]
    r, R = exact.r.astype(complex), exact.R.astype(complex)
    error = link_errors(r.astype(np.clongdouble), R.astype(np.clongdouble), base, platform, lengths).astype(
        float
    )
    complete = len(r) == MODES and bool(regular.all())
    findings = (*specialities(base, platform, lengths), *_outcome(roots, real))
    return AssemblyModes(
        r=r, R=R, real=real, regular=regular, complete=complete, error=error, exact=exact, findings=findings,
        **_of_links(r, R, real, base, platform, diameter),
    )  # fmt: skip


def _real_ones(roots: Roots) -> tuple[np.ndarray, np.ndarray]:
    """The roots with real ones made real, and which they are; the phase of a root says nothing."""
    z = roots.z * np.exp(-0.5j * np.angle((roots.z**2).sum(1)))[:, None]  # real, if any multiple is
    real = np.abs(z.imag).max(1, initial=0.0) < np.where(roots.regular, REAL, REAL_SINGULAR)
    return np.where(real[:, None], z.real, z), real


def _exact(z, regular, base, platform, lengths, size) -> ExactPoses:
    """Poses of roots in long numbers; singular roots stay where they are."""
    r, R = pose(z.astype(np.clongdouble))
    r = r * size + base.mean(0) - R @ platform.mean(0)
    error = link_errors(r, R, base, platform, lengths)
    if regular.any():
        r[regular], R[regular], error[regular] = exact_poses(z[regular], base, platform, lengths, size)
    return ExactPoses(r, R, error)


def _order(r, real, base, platform, R) -> np.ndarray:
    """Real modes by group and height, then complex ones from small imaginary parts to large."""
    side = sides(base, r.real[:, None] + platform @ R.real.swapaxes(1, 2))
    imaginary = np.round(np.abs(r.imag).max(1, initial=0.0), 9)
    first = np.where(real, side, 0)
    return np.lexsort((r[:, 2].imag, r[:, 2].real, imaginary, first, ~real))


def _of_links(r, R, real, base, platform, diameter) -> dict:
    """What links say of the real modes; what complex ones have instead."""
    count = len(r)
    group, sign = np.zeros(count, int), np.zeros(count, int)
    clearance, feasible, crossed = np.full(count, np.nan), np.zeros(count, bool), [()] * count
    if real.any():
        here = r[real].real
        ends = here[:, None] + platform @ R[real].real.swapaxes(1, 2)
        found = link_geometry(base, ends)
        group[real], sign[real] = sides(base, ends), signs(base, ends, here)
        clearance[real] = found.clearance
        feasible[real] = ~found.crossed.any(1) & (found.clearance >= diameter)
        for k, row in zip(np.flatnonzero(real), found.crossed, strict=True):
            crossed[k] = tuple((int(i), int(j)) for i, j in PAIRS[row])
    return dict(group=group, sign=sign, clearance=clearance, feasible=feasible, crossed=tuple(crossed))


def _outcome(roots: Roots, real: np.ndarray) -> list[str]:
    """Messages about missing assembly modes (at infinity, lost, none real) and about singular ones."""
    found = []
    if roots.at_infinity:
        found.append(
            f"{roots.at_infinity} of {MODES} modes are at infinity, or too far away for numbers of 16 digits"
        )
    if singular := int((~roots.regular).sum()):
        found.append(
            f"{singular} of the modes found are singular: several meet there, or the links do not hold the platform; "
            "lengths a little different separate them"
        )
    if roots.lost:
        found.append(
            f"{roots.lost} of {MODES} modes were lost on the way; lengths a little different may find them"
        )
    if not real.any():
        found.append(
            "no mode is real: links of these lengths cannot be assembled; check lengths, joints and units"
        )
    return found
