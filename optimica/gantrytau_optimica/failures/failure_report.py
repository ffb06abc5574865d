"""How a solve ended, in the model's words: what is violated, what binds and when, and what may be done about it."""

import re
from collections.abc import Sequence
from dataclasses import replace

import casadi as ca
import numpy as np

from gantrytau_optimica.control.built import Built
from gantrytau_optimica.failures.constraint_labels import Meanings, intervals, row_sizes, signal_words
from gantrytau_optimica.failures.dependence import dependent_conditions
from gantrytau_optimica.failures.kinks import WAY_OUT, kinks
from gantrytau_optimica.failures.nonfinite import not_finite
from gantrytau_optimica.solving.ipopt import FAR, NOT_BEGUN, WORDS, Solution
from gantrytau_optimica.transcription.program import Program, first_guess
from gantrytau_optimica.transcription.trajectory import Trajectory

ORDER = ("boundary", "path", "step", "border", "continuity", "algebraic", "dynamics")
MET = 1e-6  # of its size: what is violated by less is met
NEAR = 1e-5  # of its typical size: an unknown that is closer to a border is meant to be there
END = re.compile(r"^(initial|final)\((.*)\)$")
STUCK = tuple(
    WORDS[word]
    for word in (
        "Invalid_Number_Detected", "Restoration_Failed", "Error_In_Step_Computation",
        "Search_Direction_Becomes_Too_Small", "Infeasible_Problem_Detected",
    )
)  # fmt: skip
UNFINISHED = tuple(
    WORDS[word]
    for word in ("Maximum_Iterations_Exceeded", "Maximum_WallTime_Exceeded", "Solved_To_Acceptable_Level")
)


def report(built: Built, program: Program, solution: Solution, phases: Sequence[Trajectory]) -> str:
    """Status, worst violations with their times, the limits that bind, and what is known about the reason."""
    horizon = ", ".join(
        f"{'horizon' if not p.phase.name else p.phase.name} {p.start_time:.6g} to {p.final_time:.6g} s"
        for p in phases
    )
    lines = [
        f"{program.problem.name}: {solution.status} after {solution.iterations} iterations, objective "
        f"{solution.objective:.8g}, {horizon}",
        *([built.causality_words] if built.causality_words else []),
    ]
    lines += [f"`{name}` follows from the others at the end." for name in program.problem.following]
    meanings = Meanings(built, program, phases)
    lines += _numbers_lost(built, program, solution, phases)
    runaways = [] if solution.success else _runaways(program, solution, meanings)
    if runaways:
        lines += _list("Running away, farther with every step that improves the objective:", runaways, 6)
        first = runaways[0].split(" went ")[0]
        lines.append(f"Limit {first} or what it moves, or let the objective grow with it.")
    elif not solution.success and solution.status != NOT_BEGUN:
        violations = _violations(program, solution, meanings)
        lines += _list("Not met, the worst first:", violations, 8)
        if solution.status in UNFINISHED:
            lines += _accuracy(program, solution, meanings, met=not violations)
    elif solution.status in UNFINISHED:
        lines += _accuracy(program, solution, meanings, met=True)
    if not solution.success and solution.status in (*STUCK, *UNFINISHED):
        bent = _list("Not smooth, so that derivatives jump:", kinks(program.problem), 4)
        lines += [*bent, f"{WAY_OUT}."] if bent else []
    if solution.status in (WORDS["Infeasible_Problem_Detected"], WORDS["Not_Enough_Degrees_Of_Freedom"]):
        lines += _list("Depending on each other:", dependent_conditions(program), 6)
    if solution.status != NOT_BEGUN:
        reached = [line for phase in phases for line in binding(program, solution, phase)]
        lines += _list("At their limits:", reached + _binding_numbers(program, solution), 12)
    if solution.held:
        lines.append(
            "Positions of loops rest where they are kept near the first guess: another way may be better, try starts=."
        )
    if solution.success and not _objective_free(program):
        lines.append(
            "The objective depends on nothing that is free: any motion that keeps the limits is as good as this one."
        )
    return "\n".join(lines)


def _list(title: str, found: Sequence[str], most: int) -> list[str]:
    more = [f"  and {len(found) - most} more"] if len(found) > most else []
    return [title, *(f"  {line}" for line in found[:most]), *more] if found else []


def _numbers_lost(
    built: Built, program: Program, solution: Solution, phases: Sequence[Trajectory]
) -> list[str]:
    """What is not finite where the solver stopped, or at its guess."""
    if solution.success or solution.status not in (*STUCK, NOT_BEGUN):
        return []
    found = not_finite(built, phases)
    if solution.status == NOT_BEGUN:
        names = list(
            dict.fromkeys(END.sub(r"\2", name) for one in found for name in one.variables if name != "time")
        )
        lines = _list("Not finite at the first guess:", [str(one) for one in found], 6)
        which = " or ".join(names[:3]) or "the variables in it"
        return [
            *lines,
            f"Guess {which} differently, with guess={{name: value}} or a start value in the model.",
        ]
    if found:
        return _list("Not finite where it stopped:", [str(one) for one in found], 6)
    snapped = _snapped(program, solution.w)
    beside = [replace(phase, w=snapped, numbers=snapped[program.places.free]) for phase in phases]
    return _list("It stopped close to where:", [str(one) for one in not_finite(built, beside)], 6)


def _snapped(program: Program, w: np.ndarray) -> np.ndarray:
    """Unknowns with those that are almost zero, or almost at a limit, put there: where roots and logarithms end."""
    scale = program.places.scale
    w = np.where(np.abs(w) < NEAR * scale, 0.0, w)
    for bound in (program.lbw * scale, program.ubw * scale):
        with np.errstate(invalid="ignore"):
            w = np.where(np.abs(w - bound) < NEAR * scale, bound, w)
    return w


def _runaways(program: Program, solution: Solution, meanings: Meanings) -> list[str]:
    """Signals and numbers that went far away from their guess, the farthest first, what the optimiser chooses first."""
    guess, scale = first_guess(program), program.places.scale
    growth = np.nan_to_num((solution.w - guess) / scale, nan=0.0)
    chosen = {s.name for phase in program.problem.phases for s in phase.inputs}
    chosen |= {n.name for n in program.problem.free}
    farthest: dict[str, int] = {}
    for k in np.argsort(-np.abs(growth)):
        if np.abs(growth[k]) < FAR:
            break
        farthest.setdefault(meanings.unknown(int(k)).words, int(k))
    found = []
    for name, k in farthest.items():
        one = meanings.unknown(k)
        up = growth[k] > 0
        free = np.isinf((program.ubw if up else program.lbw)[k])
        why = f", without {'an upper' if up else 'a lower'} limit" if free else ""
        unit = f" {one.unit}" if one.unit else ""
        text = f"{name} went from {guess[k]:.4g} to {solution.w[k]:.3g}{unit}{one.when}{why}"
        found.append((name not in chosen, -abs(growth[k]), text))
    return [text for *_, text in sorted(found)]


def _violations(program: Program, solution: Solution, meanings: Meanings) -> list[str]:
    """What is not met, by its size relative to what it is about; conditions of the user before what the model does."""
    g = solution.constraints
    amount = np.maximum(program.lbg - g, g - program.ubg)
    amount = np.where(np.isfinite(g), amount, np.inf)
    relative = amount / row_sizes(program, solution.w)
    found = []
    for group in program.groups:
        mine = relative[group.rows]
        worst = int(np.argmax(mine))
        if amount[group.rows].max() <= MET:
            continue
        one = meanings.group(group, worst)
        row = group.rows[worst]
        value, unit = g[row] * group.size, f" {one.unit}" if one.unit else ""
        how = "is not finite" if np.isinf(amount[row]) else f"is off by {amount[row] * group.size:.3g}{unit}"
        is_value = group.kind in ("path", "boundary") and np.isfinite(value) and group.lower != group.upper
        now = f", where it is {value:.4g}" if is_value else ""
        found.append((ORDER.index(group.kind) > 2, -mine[worst], f"{one.words} {how}{one.when}{now}"))
    return [text for *_, text in sorted(found)]


def _accuracy(program: Program, solution: Solution, meanings: Meanings, met: bool) -> list[str]:
    """How far an unfinished or inaccurate solution is from meeting its conditions and from an optimum."""
    x, none = solution.w / program.places.scale, ca.DM(0, 1)
    missing = np.maximum(
        np.maximum(program.lbg - solution.constraints, solution.constraints - program.ubg), 0.0
    )
    gradient = np.array(program.assembled.grad_f(x, none)[1]).ravel()
    jacobian = program.assembled.jac_g(x, none)[1]
    pull = np.array(ca.mtimes(jacobian.T, ca.DM(solution.multipliers))).ravel()
    gradient = np.abs(gradient + pull + solution.bound_multipliers * program.places.scale)
    if not (np.all(np.isfinite(gradient)) and missing.size):
        return []
    lines = []
    row = int(np.argmax(missing))
    if met:
        one = meanings.row(row)
        least = f", least of all {one.words}{one.when}" if missing[row] > 0 else ""
        lines.append(f"Conditions are met within {missing[row]:.2g} of their size{least}")
    one = meanings.unknown(int(np.argmax(gradient)))
    lines.append(
        f"The objective could still change by about {np.max(gradient):.2g} where {one.words} changes by {one.size:.3g}"
        f"{' ' + one.unit if one.unit else ''}{one.when}; 0 would be an optimum"
    )
    return [f"{line}." for line in lines]


def _objective_free(program: Program) -> bool:
    """Whether the objective depends on an unknown that is not held."""
    gradient = program.assembled.grad_f.sparsity_out(1)
    columns = np.array(gradient.row(), dtype=int)
    held = program.lbw == program.ubw
    _, value = program.assembled.grad_f(np.linspace(0.3, 0.9, program.places.size), ca.DM(0, 1))
    dense = gradient.nnz() == program.places.size
    used = np.array(value.nonzeros()) != 0.0 if dense else np.ones(columns.size, bool)
    return bool(np.any(~held[columns] & used))


def binding(program: Program, solution: Solution, trajectory: Trajectory) -> list[str]:
    """Limits of one phase that are reached, with the intervals of time."""
    found: list[str] = []
    layout = trajectory.layout
    times = trajectory.times(layout.fractions)
    lower, upper = program.lbw * program.places.scale, program.ubw * program.places.scale
    for number, signal in enumerate(trajectory.phase.signals):
        places = layout.tracks[number].unknowns[:, -1] if number in layout.chains else layout.of(number)
        moments = trajectory.times(trajectory.mesh.borders[1:]) if number in layout.chains else None
        when = trajectory.times(layout.moment[places - layout.first]) if moments is None else moments
        value = solution.w[places]
        for word, bound in (("lower", lower[places]), ("upper", upper[places])):
            reached = _reached(value, bound)
            if np.any(reached):
                kept = signal.is_root and bound[reached][0] > 0
                off = f" but for a margin of {bound[reached][0]:.3g}" if kept else ""
                found.append(
                    f"{signal.words}{off} {intervals(reached, when)}"
                    if signal.words and signal.words != signal.name
                    else f"{signal_words(trajectory.phase, number)} at its {word} limit {bound[reached][0]:.6g} "
                    f"{intervals(reached, when)}"
                )
    number = program.places.layouts.index(layout)
    for group in program.groups:
        if group.kind != "path" or group.phase != number:
            continue
        for word, bound in (("lower", group.lower), ("upper", group.upper)):
            reached = _reached(solution.constraints[group.rows] * group.size, np.full(group.rows.size, bound))
            if np.any(reached):
                found.append(f"`{group.name}` at its {word} limit {intervals(reached, times)}")
    return found


def _binding_numbers(program: Program, solution: Solution) -> list[str]:
    found = []
    lower, upper = program.lbw * program.places.scale, program.ubw * program.places.scale
    for number, place in zip(program.problem.free, program.places.free, strict=True):
        if number.held:
            continue
        for word, bound in (("lower", lower[place]), ("upper", upper[place])):
            if _reached(solution.w[place], bound):
                found.append(f"{number.name} at its {word} limit {bound:.6g}")
    return found


def _reached(value: np.ndarray, bound: np.ndarray) -> np.ndarray:
    with np.errstate(invalid="ignore"):
        return np.isfinite(bound) & (np.abs(value - bound) <= 1e-6 * np.maximum(1.0, np.abs(bound)))
