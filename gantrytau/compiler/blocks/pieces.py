"""Equations that switch on their own unknowns, in closed form: the solution of every piece, and the piece it lies in.

Between its switches a block is linear (or one quadratic): with chosen modes its unknowns follow outright. A choice is
consistent if the margins, at the unknowns that follow, have the signs that were chosen. Of several consistent ones that
is taken which differs least from the start. Of what counts, one floor of a margin, the numbers that can be follow from the
slope of the margin. Modes have no derivatives, so those of the solution are of its own piece.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import casadi as ca

from gantrytau.compiler.blocks.pivots import Guide
from gantrytau.compiler.blocks.quadratics import root_of
from gantrytau.language.piecewise import Switched, Turn, with_modes
from gantrytau.language.term_sizes import term_sizes

MOST_SWITCHES = 7
MOST_CANDIDATES = 96
MOST_UNKNOWNS = 4
LARGEST = 1e300  # of an unknown: more is a division by zero
SINGULAR = 1e-12  # of an equation, what may be left of it where equations depend on each other
ROUNDING = 1e-11  # of a residual relative to its terms, at a border where no piece is strictly consistent


@dataclass(frozen=True, eq=False)
class _Forms:
    """Residuals curvature/2 y^2 + matrix y + constant, in modes; curvature is zero where all pieces are linear."""

    modes: ca.SX
    curvature: ca.SX
    matrix: ca.SX
    constant: ca.SX

    def at(self, values: ca.SX) -> "_Forms":
        """The same with values of the modes."""
        forms = (self.curvature, self.matrix, self.constant)
        return _Forms(self.modes, *(ca.substitute(e, self.modes, values) for e in forms))

    def solution(self, side: ca.SX) -> ca.SX:
        """The unknowns; side: the sign of the slope at the root of a quadratic."""
        if self.curvature.is_zero():
            return solve_by_value(self.matrix, -self.constant)
        w = side * ca.sqrt(self.radicand)
        return root_of(self.curvature, self.matrix, self.constant, w)

    @property
    def radicand(self) -> ca.SX:
        return self.matrix**2 - 2 * self.curvature * self.constant


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A choice: numbers of the modes, the sign of the slope of a single unknown (else 0), the unknowns that follow.

    sound: whether it counts at all, where it agrees with its margins; along: whether the slope has its sign at the start.
    """

    modes: ca.SX
    side: ca.SX
    y: ca.SX
    sound: ca.SX
    along: ca.SX


def in_pieces(found: Switched, y: ca.SX, guide: Guide) -> tuple[tuple[ca.SX, ...], ca.SX] | None:
    """The unknowns y of residuals with modes, and how many pieces hold a solution; None if there are too many pieces."""
    turns = found.switches
    if len(turns) > MOST_SWITCHES or y.numel() > MOST_UNKNOWNS:
        return None
    forms = _forms(found, y)
    candidates = [] if forms is None else _candidates(forms, found, y, guide)
    if forms is None or not 0 < len(candidates) <= MOST_CANDIDATES:
        return None
    agreeing = [_agrees(c, turns, forms.modes, y) for c in candidates]
    on_branch = [agrees * c.along for agrees, c in zip(agreeing, candidates, strict=True)]
    count, missing, taken = sum(agreeing, start=ca.SX(0)), ca.SX(1), [ca.SX(0)] * len(candidates)
    for k, agrees in enumerate((*on_branch, *agreeing, *_nearly(found, candidates, y))):
        if k >= 2 * len(candidates):  # those count only where no other does
            count += missing * agrees
        taken[k % len(candidates)] += missing * agrees
        missing = missing * (1 - agrees)
    modes, side = (
        sum((ca.if_else(t, e, 0) for t, e in zip(taken, of, strict=True)), start=ca.SX(0))
        for of in ([c.modes for c in candidates], [c.side for c in candidates])
    )
    solution = forms.at(modes).solution(side) + ca.if_else(missing, ca.SX.nan(), 0)
    return tuple(solution.elements()), count


def _forms(found: Switched, y: ca.SX) -> _Forms | None:
    """None where a piece has no closed form."""
    residual, modes = ca.vertcat(*found.expressions), ca.vertcat(*(t.mode for t in found.switches))
    matrix, zero = ca.densify(ca.jacobian(residual, y)), ca.SX.zeros(*y.shape)
    constant = ca.substitute(residual, y, zero)
    counting = [t for t in found.switches if t.counts]
    for turn in counting:
        straight = ca.vertcat(ca.vec(matrix), ca.gradient(turn.margin, y), ca.jacobian(constant, turn.mode))
        if len(counting) > 1 or ca.depends_on(straight, ca.vertcat(y, turn.mode)):
            return None
    if not ca.depends_on(matrix, y):
        return _Forms(modes, ca.SX(0), matrix, constant)
    if y.numel() > 1 or counting:
        return None
    curvature = ca.densify(ca.jacobian(matrix, y))
    if ca.depends_on(curvature, y):
        return None
    return _Forms(modes, curvature, ca.substitute(matrix, y, zero), constant)


def _candidates(forms: _Forms, found: Switched, y: ca.SX, guide: Guide) -> list[_Candidate]:
    """All choices that can be, the nearest to the start first."""
    turns, modes = found.switches, forms.modes
    single = y.numel() == 1
    slope = forms.matrix + forms.curvature * y if single else ca.SX(0)
    start, slope = (guide.at_start(e) for e in with_modes(found, [modes, slope]))
    side = ca.SX(1.0 if float(slope[0, 0]) >= 0 else -1.0)
    start = start.ravel().tolist()
    options = [(b,) if t.counts else (0.0, 1.0) for t, b in zip(turns, start, strict=True)]
    choices = sorted(product(*options), key=lambda c: sum(abs(a - b) for a, b in zip(c, start, strict=True)))
    candidates: list[_Candidate] = []
    for values in _counted(choices, forms, turns, y):
        if _contradicts(values, turns, modes):
            continue
        piece = forms.at(values)
        if not piece.curvature.is_zero():
            here, there = piece.solution(side), piece.solution(-side)
            candidates.append(_Candidate(values, side, here, ca.SX(1), ca.SX(1)))
            double = piece.radicand <= 0  # a double root is one
            candidates.append(_Candidate(values, -side, there, 1 - double, ca.SX(0)))
        elif ca.sprank(ca.sparsify(piece.matrix)) == y.numel():
            line = ca.if_else(piece.matrix >= 0, 1, -1) if single else ca.SX(0)
            along = line == side if single else ca.SX(1)
            candidates.append(_Candidate(values, line, piece.solution(line), ca.SX(1), along))
    return candidates


def _counted(
    choices: Sequence[Sequence[float]], forms: _Forms, turns: Sequence[Turn], y: ca.SX
) -> Iterator[ca.SX]:
    """The choices, and for what counts the numbers that can be: the nearest to the start, and its neighbours.

    With the other modes chosen the margin is a + b * mode, and 0 <= a - (1 - b) * mode < 1.
    """
    place = next((k for k, t in enumerate(turns) if t.counts), None)
    for choice in choices:
        values = ca.SX(ca.DM(choice))
        if place is None:
            yield values
            continue
        mode = turns[place].mode
        values[place] = mode
        piece = forms.at(values)
        if ca.sprank(ca.sparsify(piece.matrix)) < y.numel():
            continue
        old, new = ca.vertcat(y, forms.modes), ca.vertcat(piece.solution(ca.SX(0)), values)
        margin = ca.substitute(turns[place].margin, old, new)
        a, b = ca.substitute(margin, mode, 0), ca.substitute(margin, mode, 1)
        slope = 1 - (b - a)
        ends = [a / slope, (a - 1) / slope]
        low, high = ca.ceil(ca.fmin(*ends)), ca.floor(ca.fmax(*ends))
        middle = ca.fmin(ca.fmax(low, choice[place]), high)
        for number in (middle, middle - 1, middle + 1):  # at a border it is a matter of rounding
            values[place] = number
            yield ca.SX(values)


def _contradicts(values: ca.SX, turns: Sequence[Turn], modes: ca.SX) -> bool:
    """Whether no unknowns can lead to these modes."""
    margins = [ca.substitute(t.margin, modes, values) for t in turns]
    for k, (turn, margin) in enumerate(zip(turns, margins, strict=True)):
        if turn.counts:
            continue
        mode = float(values[k])
        if margin.is_constant() and float(Turn(margin, margin, turn.closed).value) != mode:
            return True
        for m, other in enumerate(margins[:k]):
            if not turns[m].counts and _opposite(margin, other):
                both = mode + float(values[m])
                if (both == 2 and not (turn.closed and turns[m].closed)) or (
                    both == 0 and (turn.closed or turns[m].closed)
                ):
                    return True
    return False


def _opposite(a: ca.SX, b: ca.SX) -> bool:
    return ca.is_equal(a, -b, 3) or ca.is_equal(-a, b, 3)


def _agrees(candidate: _Candidate, turns: Sequence[Turn], modes: ca.SX, y: ca.SX) -> ca.SX:
    """1 where the margins have the signs that were chosen, else 0."""
    old, new = ca.vertcat(y, modes), ca.vertcat(candidate.y, candidate.modes)
    agrees = candidate.sound
    for element in candidate.y.elements():
        agrees = agrees * (ca.fabs(element) <= LARGEST)
    for k, turn in enumerate(turns):
        margin = ca.substitute(turn.margin, old, new)
        value = Turn(turn.mode, margin, turn.closed, turn.counts).value
        agrees = agrees * (value == candidate.modes[k])
    return agrees


def _nearly(found: Switched, candidates: Sequence[_Candidate], y: ca.SX) -> list[ca.SX]:
    """1 where unknowns satisfy the equations as they are, in whatever piece rounding has put them."""
    residuals = with_modes(found, found.expressions)
    wrong = ca.vertcat(*residuals)
    sizes = ca.vertcat(*term_sizes([e for r in residuals for e in r.elements()]))
    holds = []
    for candidate in candidates:
        off, size = (ca.substitute(e, y, candidate.y).elements() for e in (wrong, sizes))
        agrees = candidate.sound
        for one, of in zip(off, size, strict=True):
            agrees = agrees * (ca.fabs(one) <= ROUNDING * of)
        holds.append(agrees)
    return holds


def solve_by_value(matrix: ca.SX, right: ca.SX, rows: Sequence[ca.SX] = ()) -> ca.SX:
    """Elimination of a few unknowns with the pivots that are largest when it is evaluated.

    rows: how large the equations were before others were inserted; then NaN where the rest of one may be rounding.
    """
    n = matrix.shape[0]
    if n == 1 and not rows:
        return right / matrix
    a = [[*(matrix[i, j] for j in range(n)), right[i]] for i in range(n)]
    for i, row in enumerate(a):
        size = rows[i] if rows else ca.SX(0)
        for entry in row[:n]:
            size = size if entry.is_zero() else ca.fmax(size, ca.fabs(entry))
        row[:] = [entry / size for entry in row]
    for k in range(n):
        for i in range(k + 1, n):
            _larger_first(a, k, i)
        if rows:
            a[k][k] = ca.if_else(ca.fabs(a[k][k]) > SINGULAR, a[k][k], ca.SX.nan())
        for i in range(k + 1, n):
            if not a[i][k].is_zero():
                factor = a[i][k] / a[k][k]
                a[i] = [ca.SX(0)] * (k + 1) + [a[i][j] - factor * a[k][j] for j in range(k + 1, n + 1)]
    x = [ca.SX(0)] * n
    for k in reversed(range(n)):
        total = a[k][n]
        for j in range(k + 1, n):
            total = total - a[k][j] * x[j]
        x[k] = total / a[k][k]
    return ca.vertcat(*x)


def _larger_first(a: list[list[ca.SX]], k: int, i: int) -> None:
    """Exchange two rows where the later one has the larger pivot."""
    if a[i][k].is_zero():
        return
    larger = ca.SX(1) if a[k][k].is_zero() else ca.fabs(a[i][k]) > ca.fabs(a[k][k])
    if larger.is_constant():
        if float(larger):
            a[k], a[i] = a[i], a[k]
        return
    pairs = list(zip(a[k], a[i], strict=True))
    a[k] = [ca.if_else(larger, other, one) for one, other in pairs]
    a[i] = [ca.if_else(larger, one, other) for one, other in pairs]
