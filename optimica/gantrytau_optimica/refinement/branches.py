"""The branches of solutions that a search found: what is one branch, how branches are ranked and told."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.control.control_problem import Phase
from gantrytau_optimica.refinement.features import distinctions
from gantrytau_optimica.refinement.guess_family import coordinates

SAME = 1e-3  # relative: objectives that are closer may be of one branch
SAME_COARSE = 1e-2  # the same on different meshes
SAME_COURSE = 0.1  # of their range: states that differ by less, in the mean, take the same course
MISSES = 0.1  # of its size, by which a branch may miss conditions: what refinement makes good
PASSES = 0.02  # of its range, by which it may pass limits: what passes them by more may have jumped over an obstacle
SHARES = np.linspace(0.0, 1.0, 41)
MOST_TOLD = 8


@dataclass(frozen=True)
class SolutionBranch:
    """Solutions of one kind: how many first guesses led there, and the best of them.

    whole: whether that is a solution on the whole mesh; words: what distinguishes it from the other branches.
    """

    objective: float
    count: int
    optimum: Optimum
    whole: bool = True
    words: str = ""

    @cached_property
    def missed(self) -> float:
        """By how much conditions are missed when played back, the worst relative to its size; inf where it gets stuck."""
        played = self.optimum.playback
        worst = max((d.relative for d in played.defects), default=0.0)
        return worst if played.complete and np.isfinite(worst) else np.inf

    @cached_property
    def passed(self) -> float:
        """By how much limits are passed when played back, the worst relative to its range."""
        return self.optimum.playback.violation

    @cached_property
    def holds(self) -> bool:
        """Whether it is a motion of the model: played back it meets conditions and limits but for what a mesh leaves.

        Limits on inputs do not count, as free inputs pass them between points whatever the branch.
        """
        inputs = {name for t in self.optimum.phases.values() for name in _input_limits(t.phase)}
        others = (v.relative for v in self.optimum.playback.violations if v.name not in inputs)
        return self.missed <= MISSES and max(others, default=0.0) <= PASSES

    @property
    def rank(self) -> tuple[bool, bool, float]:
        """The least is the best: what is solved on the whole mesh, and of that what holds, before the rest."""
        return not self.whole, self.whole and not self.holds, self.objective


@dataclass(frozen=True)
class Search:
    """All branches, the best first, how many guesses were tried, and how many of them led to no solution.

    stopped: why the search ended before all guesses were tried, if it did.
    """

    starts: int
    branches: tuple[SolutionBranch, ...]
    failures: int
    stopped: str = ""

    def __str__(self) -> str:
        many = "1 branch" if len(self.branches) == 1 else f"{len(self.branches)} branches"
        said = f"{self.starts} first guesses led to {many}, {self.failures} to no solution"
        lines = [f"{said} ({self.stopped}):" if self.stopped else f"{said}:"]
        table = [("", "objective", "guesses", "holds", "missed", "passed", "what distinguishes it")]
        table += [_cells(number, b) for number, b in enumerate(self.branches[:MOST_TOLD], 1)]
        widths = [max(len(row[k]) for row in table) for k in range(6)]
        for *cells, words in table:
            aligned = "  ".join(cell.rjust(width) for cell, width in zip(cells, widths, strict=True))
            first, *more = words.split("; ")
            lines.append(f"{aligned}  {first}".rstrip())
            lines += [f"{'':{len(aligned)}}  {line}" for line in more]
        if len(self.branches) > MOST_TOLD:
            lines.append(f"  and {len(self.branches) - MOST_TOLD} more")
        lines.append("  missed, passed: conditions and limits when played back, of their size")
        return "\n".join(lines)


def _cells(number: int, branch: SolutionBranch) -> tuple[str, ...]:
    first = (str(number), f"{branch.objective:.8g}", str(branch.count))
    if not branch.whole:
        return (*first, "-", "-", "-", "; ".join(filter(None, ["on a coarse mesh only", branch.words])))
    holds = "yes" if branch.holds else "no"
    return (*first, holds, f"{branch.missed:.1g}", f"{branch.passed:.1g}", branch.words)


def _input_limits(phase: Phase) -> set[str]:
    """Names of the limits in which inputs occur."""
    inputs = ca.vertcat(ca.SX(0, 1), *(s.symbol for s in phase.inputs))
    if not phase.inputs:
        return set()
    return {limit.name for limit in phase.path_limits if ca.depends_on(limit.expression, inputs)}


def joined(branches: Sequence[SolutionBranch], within: float = SAME) -> list[SolutionBranch]:
    """Branches with those put together that are one: alike in their objective, relative, and in the course of the states.

    What is solved on the whole mesh stands for what is not, else the better one.
    """
    found: list[SolutionBranch] = []
    ordered = sorted(branches, key=lambda b: (not b.whole, b.objective))
    for branch in ordered:
        for k, other in enumerate(found):
            coarse = SAME_COARSE if other.whole != branch.whole else within
            if _alike(branch, other, coarse):
                found[k] = replace(other, count=other.count + branch.count)
                break
        else:
            found.append(branch)
    return found


def ranked(branches: Sequence[SolutionBranch]) -> tuple[SolutionBranch, ...]:
    """Branches in the order of their rank, with words for what distinguishes them."""
    ordered = sorted(branches, key=lambda b: b.rank)
    words = distinctions([b.optimum for b in ordered])
    return tuple(replace(b, words=said) for b, said in zip(ordered, words, strict=True))


def _alike(one: SolutionBranch, other: SolutionBranch, within: float) -> bool:
    if abs(one.objective - other.objective) > within * abs(other.objective):
        return False
    for path, phase in one.optimum.phases.items():
        a, b = (_course(o, path) for o in (one.optimum, other.optimum))
        size = np.array([s.nominal for s in coordinates(phase.phase)])
        width = np.maximum(np.ptp(np.hstack([a, b]), axis=1), 1e-3 * size)
        apart = np.sqrt(np.mean((a - b) ** 2, axis=1))
        if np.any(apart > SAME_COURSE * width):
            return False
    if any(phase.phase.states for phase in one.optimum.phases.values()):
        return True
    a, b = (np.array(list(o.optimum.free.values())) for o in (one, other))
    sizes = np.array([n.size for n in one.optimum.built.problem.free if not n.held])
    return bool(np.all(np.abs(a - b) <= SAME_COURSE * np.maximum(sizes, np.abs(a))))


def _course(optimum: Optimum, path: str) -> np.ndarray:
    """States that are no derivatives of others over shares of the horizon, (n, 41)."""
    trajectory = optimum.phases[path]
    wanted = coordinates(trajectory.phase)
    symbols = ca.vertcat(ca.SX(0, 1), *(s.symbol for s in wanted))
    return trajectory.values(symbols, trajectory.times(SHARES)) if wanted else np.zeros((0, SHARES.size))
