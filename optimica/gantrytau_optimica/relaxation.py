"""What would have to give: the problem with limits and conditions that may yield, at a price, while the model holds.

    minimise    sum over conditions of weight * s
    subject to  the equations of the model as they are
                lower - size s <= row <= upper + size s        limits and conditions of the user
                lower - size s <= unknown <= upper + size s    limits of signals and free numbers
                s >= 0

One s for each condition, for all times: what would be asked instead of it. The sum of absolute values is what makes few
conditions yield instead of all a little (an exact penalty: Nocedal and Wright (2006), section 17.2).
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from scipy import sparse

from gantrytau.interruption import on_interrupt
from gantrytau_optimica.building import Built
from gantrytau_optimica.ipopt import WORDS, Solution, Watch
from gantrytau_optimica.meaning import Meanings, first_guess, intervals, row_sizes
from gantrytau_optimica.program import Program, transcribe
from gantrytau_optimica.records import FreeNumber
from gantrytau_optimica.sorting import bare_limit
from gantrytau_optimica.trajectory import Trajectory

SMALL = 1e-6  # of its size: what gives way by less holds
SINGLE = 4  # conditions that are tried alone
START = 2.0  # price of a start against other conditions: it is a fact more often than a wish
LATER = (
    0.02  # by which what is written later is cheaper, so that of two equals one gives way, not both by half
)
MODERATE = 20000  # unknowns up to which the answer is looked for without being asked for
LINKS = (" begins where ", " begins when ")  # conditions between phases belong to the model


@dataclass(frozen=True)
class Concession:
    """A condition that gives way by `amount`, in `unit`: name as written; when: words for the times at which it is used."""

    name: str
    amount: float
    unit: str
    when: str
    share: float  # of its typical size

    def __str__(self) -> str:
        when = f" {self.when}" if self.when else ""
        return f"`{self.name}` gave way by {self.amount:.3g}{' ' + self.unit if self.unit else ''}{when}"


@dataclass(frozen=True, eq=False)
class Relaxed:
    """What would have to give: ways, each of conditions that yield together, fewest conditions first.

    found: whether there is an answer; ways is empty where all conditions can be met together. solution: the unknowns of
    the cheapest motion.
    """

    ways: tuple[tuple[Concession, ...], ...]
    found: bool
    solution: Solution

    def __str__(self) -> str:
        if not self.found:
            return "What would have to give was not found."
        if not self.ways:
            return (
                "All limits and conditions can be met together; solve again with guess=error.optimum.nearest."
            )
        ways = [" and ".join(map(str, way)) for way in self.ways]
        return "It could be solved if " + ";\n  or if ".join(ways) + "."


@dataclass(frozen=True, eq=False)
class _Soft:
    """A condition that may yield: on rows, or on unknowns; lower, upper, price for a yield of `size`, largest yield."""

    name: str
    of_rows: bool
    where: np.ndarray
    lower: float  # in the unit of the quantity
    upper: float
    size: float
    scale: float  # a row or unknown of the program times this is the quantity
    price: float
    moments: np.ndarray
    phase: int
    most: float = np.inf


def worth_relaxing(program: Program, solution: Solution) -> bool:
    """Whether to look for what would have to give without being asked: nothing was found, and it takes seconds."""
    words = (WORDS["Infeasible_Problem_Detected"], WORDS["Restoration_Failed"])
    return solution.status in words and program.places.size <= MODERATE


def relax(built: Built, program: Program, solution: Solution, seconds: float = 5.0) -> Relaxed:
    """The least that would have to give, looked for during `seconds` from where `solution` ended, and from the guess."""
    end = time.perf_counter() + seconds
    guess = first_guess(program)
    softs = _softs(program, guess)
    elastic = _Elastic(program, softs)
    starts = [w for w in (solution.w, guess) if np.all(np.isfinite(w)) and np.max(np.abs(w)) < 1e10]
    for start in starts:
        found = elastic.solve(start, range(len(softs)), end)
        if found is not None:
            break
    else:
        return Relaxed((), False, solution)
    w, yields, duals = found
    unsolved = replace(
        solution, w=w, constraints=np.array(program.assembled.nlp(w / program.places.scale, [])[1]).ravel()
    )
    first = [k for k in np.argsort(-yields) if yields[k] > SMALL]
    if not first:
        return Relaxed((), True, unsolved)
    ways = [(_Way(tuple(first), yields, w))]
    helpful = [k for k in np.argsort(-duals) if duals[k] > 1e-3 * softs[k].price and [k] != first]
    for k in helpful[:SINGLE]:
        alone = elastic.solve(w, [k], end)
        if alone is not None and SMALL < alone[1][k] < 1e3:
            ways.append(_Way((k,), alone[1], alone[0]))
    if any(
        len(way.which) == 1 for way in ways
    ):  # one condition is easier to discuss than several, though dearer
        ways = [way for way in ways if len(way.which) == 1]
    ways.sort(key=lambda way: (len(way.which), sum(softs[k].price * way.yields[k] for k in way.which)))
    told = [_told(built, program, softs, way) for way in ways]
    longer = _other_duration(program, w, end)
    return Relaxed((*told, *([(longer,)] if longer else [])), True, unsolved)


def _other_duration(program: Program, w: np.ndarray, end: float) -> Concession | None:
    """The nearest final time, where it is a fixed number, at which all other conditions hold; None if there is none."""
    problem = program.problem
    (phase, *others), (layout, *_) = problem.phases, program.places.layouts
    fixed = phase.start_time.is_constant() and phase.final_time.is_constant()
    if (
        others
        or not fixed
        or phase.courses
        or phase.sums
        or any(not isinstance(p.time, str) for p in phase.points)
    ):
        return None
    start, stop = float(phase.start_time), float(phase.final_time)
    symbol, span = ca.SX.sym("final_time"), stop - start
    number = FreeNumber("final_time", symbol, start + 1e-3 * span, start + 1e3 * span, stop)
    changed = replace(problem, phases=(replace(phase, final_time=symbol),), free=(*problem.free, number))
    variant = transcribe(changed, [layout.mesh], layout.scheme)
    place = len(problem.free)
    name = f"final_time = {stop:g}"
    soft = _Soft(
        name,
        False,
        np.array([place]),
        stop,
        stop,
        span,
        variant.places.scale[place],
        1.0,
        np.array([np.nan]),
        -1,
    )
    found = _Elastic(variant, [soft]).solve(np.insert(w, place, stop), [0], end)
    if found is None or found[1][0] < SMALL:
        return None
    return Concession(name, float(found[1][0] * span), "s", f"to {found[0][place]:.4g} s", float(found[1][0]))


@dataclass(frozen=True, eq=False)
class _Way:
    which: tuple[int, ...]
    yields: np.ndarray
    w: np.ndarray


def _told(built: Built, program: Program, softs: Sequence[_Soft], way: _Way) -> tuple[Concession, ...]:
    numbers = way.w[program.places.free]
    phases = [Trajectory(program.problem, layout, way.w, numbers) for layout in program.places.layouts]
    units = Meanings(built, program, phases).units
    rows = np.array(program.assembled.nlp(way.w / program.places.scale, [])[1]).ravel()
    found = []
    for k in way.which:
        soft, amount = softs[k], way.yields[k] * softs[k].size
        value = rows[soft.where] * soft.scale if soft.of_rows else way.w[soft.where]
        used = np.maximum(soft.lower - value, value - soft.upper) > 0.99 * amount
        timed = soft.phase >= 0 and not np.isnan(soft.moments).any()
        when = intervals(used, phases[soft.phase].times(soft.moments)) if timed else ""
        unit = units.get(soft.name, units.get(soft.name.split(" of ", 1)[-1], ""))
        found.append(Concession(soft.name, float(amount), unit, when, float(way.yields[k])))
    return tuple(found)


def _softs(program: Program, w: np.ndarray) -> list[_Soft]:
    """All that may yield, in the order in which it is written."""
    sizes = row_sizes(program, w)
    found = [
        _Soft(
            f"largest step of {g.name}" if g.kind == "step" else g.name, True, g.rows, g.lower, g.upper,
            float(np.median(sizes[g.rows])) * g.size, g.size, 1.0, g.moments, g.phase,
        )
        for g in program.groups
        if g.kind in ("path", "boundary", "step") and not any(word in g.name for word in LINKS)
    ]  # fmt: skip
    found += _soft_signals(program)
    for place, number in zip(program.places.free, program.problem.free, strict=True):
        if number.held or not (np.isfinite(number.min) or np.isfinite(number.max)):
            continue
        # a mass or a time above zero stays there
        most = np.inf if number.min < 0 or np.isinf(number.min) else 0.999 * number.min
        scale = float(program.places.scale[place])
        for name, low, high, limit in (
            (f"min of {number.name}", number.min, np.inf, most),
            (f"max of {number.name}", -np.inf, number.max, np.inf),
        ):
            if np.isfinite(low) or np.isfinite(high):
                found.append(
                    _Soft(
                        name,
                        False,
                        np.array([place]),
                        low,
                        high,
                        scale,
                        scale,
                        1.0,
                        np.array([np.nan]),
                        -1,
                        limit,
                    )
                )
    count = max(len(found) - 1, 1)
    return [
        replace(s, price=(START if _is_start(s.name) else 1.0) * (1 - LATER * k / count))
        for k, s in enumerate(found)
    ]


def _is_start(name: str) -> bool:
    return name.startswith(("initial(", "initial equation"))


def _soft_signals(program: Program) -> Iterator[_Soft]:
    """Limits of signals, lower and upper together where they are written together."""
    for number, layout in enumerate(program.places.layouts):
        names: dict[tuple[str, str], tuple[float, float]] = {}
        for limit in layout.phase.path_limits:
            bare = bare_limit(limit, layout.phase)
            if bare is not None:
                names[bare[0], limit.name] = bare[1:]
        for (signal, name), (low, high) in names.items():
            k = next(i for i, s in enumerate(layout.phase.signals) if s.name == signal)
            where, size = layout.of(k), layout.phase.signals[k].nominal
            moments = layout.moment[where - layout.first]
            yield _Soft(name, False, where, low, high, size, size, 1.0, moments, number)


class _Elastic:
    """The relaxed program for Ipopt; which conditions may yield is said at each solve."""

    def __init__(self, program: Program, softs: Sequence[_Soft]):
        self.program, self.softs = program, softs
        assembled, places = program.assembled, program.places
        hard = np.setdiff1d(
            np.arange(assembled.rows),
            np.concatenate([np.zeros(0, int), *(s.where for s in softs if s.of_rows)]),
        )
        select, pick, give, low, high = (
            [hard],
            [np.full(hard.size, -1)],
            [np.zeros(hard.size)],
            [program.lbg[hard]],
            [program.ubg[hard]],
        )
        owner = [np.full(hard.size, -1)]
        for k, soft in enumerate(softs):
            for bound, sign in ((soft.lower, 1.0), (soft.upper, -1.0)):
                if not np.isfinite(bound):
                    continue
                n = soft.where.size
                none = np.full(n, -1)
                select.append(soft.where if soft.of_rows else none)
                pick.append(none if soft.of_rows else soft.where)
                give.append(np.full(n, sign * soft.size / soft.scale))
                owner.append(np.full(n, k))
                low.append(np.full(n, bound / soft.scale if sign > 0 else -np.inf))
                high.append(np.full(n, bound / soft.scale if sign < 0 else np.inf))
        self.low, self.high = np.concatenate(low), np.concatenate(high)
        self.owner, self.give = np.concatenate(owner), np.concatenate(give)
        rows, n, m = self.owner.size, places.size, len(softs)
        self.select = _matrix(np.concatenate(select), np.ones(rows), (rows, assembled.rows))
        self.pick = _matrix(np.concatenate(pick), np.ones(rows), (rows, n))
        self.yielding = _matrix(self.owner, self.give, (rows, m))
        self.lbw, self.ubw = _hard_bounds(program, softs)
        self.rows, self.size = rows, n

    @cached_property
    def functions(self) -> tuple[ca.Function, dict[str, Any]]:
        """The program and its derivatives, in the form that CasADi's nlpsol takes."""
        n, m, assembled = self.size, len(self.softs), self.program.assembled
        x, p = ca.MX.sym("x", n + m), ca.MX.sym("p", 0)
        w, s = x[:n], x[n:]
        price = ca.DM([soft.price for soft in self.softs]) if m else ca.DM(0, 1)
        select, pick, yielding = _dm(self.select), _dm(self.pick), _dm(self.yielding)
        g = ca.mtimes(select, assembled.nlp(w, p)[1]) + ca.mtimes(pick, w) + ca.mtimes(yielding, s)
        jacobian = ca.horzcat(ca.mtimes(select, assembled.jac_g(w, p)[1]) + pick, yielding)
        lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", self.rows)
        inner = assembled.hess_lag(w, p, 0.0, ca.mtimes(select.T, lam_g))
        hessian = ca.diagcat(inner, ca.MX(m, m))
        f = ca.dot(price, s)
        gradient = ca.vertcat(ca.MX.zeros(n), price)
        nlp = ca.Function("nlp", [x, p], [f, ca.densify(g)], ["x", "p"], ["f", "g"])
        return nlp, {
            "grad_f": ca.Function("nlp_grad_f", [x, p], [ca.MX(1, 1), ca.densify(gradient)], ["x", "p"], ["f", "grad_f_x"]),
            "jac_g": ca.Function("nlp_jac_g", [x, p], [ca.MX(self.rows, 1), jacobian], ["x", "p"], ["g", "jac_g_x"]),
            "hess_lag": ca.Function(
                "nlp_hess_l", [x, p, lam_f, lam_g], [hessian], ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"]
            ),
        }  # fmt: skip

    def solve(
        self, start: np.ndarray, which: Sequence[int] | range, end: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """Unknowns, yields of all conditions relative to their size, and their worth; None if none was found in time."""
        left = end - time.perf_counter()
        if left < 0.05:
            return None
        nlp, derivatives = self.functions
        m = len(self.softs)
        watch = Watch(self.size + m, self.rows, None)
        options = {
            "iteration_callback": watch,
            "print_time": False,
            "calc_lam_p": False,
            "show_eval_warnings": False,
        }
        ipopt = {
            "print_level": 0,
            "sb": "yes",
            "mu_strategy": "adaptive",
            "tol": 1e-8,
            "max_iter": 500,
            "max_wall_time": left,
        }
        solver = ca.nlpsol("relaxed", "ipopt", nlp, options | derivatives | {"ipopt": ipopt})
        most = np.zeros(m)
        most[list(which)] = [self.softs[k].most / self.softs[k].size for k in which]
        scaled = start / self.program.places.scale
        with on_interrupt(watch.ask_to_stop):
            found = solver(
                x0=np.concatenate([scaled, self._needed(scaled)]),
                lbx=np.concatenate([self.lbw, np.zeros(m)]),
                ubx=np.concatenate([self.ubw, most]),
                lbg=self.low,
                ubg=self.high,
            )
        if not solver.stats()["success"]:
            return None
        x, duals = np.array(found["x"]).ravel(), np.array(found["lam_g"]).ravel()
        worth = np.zeros(m)
        mine = self.owner >= 0
        np.add.at(worth, self.owner[mine], np.abs(duals * self.give)[mine])
        return x[: self.size] * self.program.places.scale, x[self.size :], worth

    def _needed(self, scaled: np.ndarray) -> np.ndarray:
        """How far each condition would have to give way at these unknowns, and a little more."""
        g = np.array(self.program.assembled.nlp(scaled, [])[1]).ravel()
        value = self.select @ np.nan_to_num(g) + self.pick @ scaled
        missing = np.maximum(np.maximum(self.low - value, value - self.high), 0.0)
        found = np.zeros(len(self.softs))
        mine = self.owner >= 0
        np.maximum.at(found, self.owner[mine], (missing / np.where(mine, np.abs(self.give), 1.0))[mine])
        return np.minimum(1.1 * found + 0.01, 1e6)


def _hard_bounds(program: Program, softs: Sequence[_Soft]) -> tuple[np.ndarray, np.ndarray]:
    """Limits of the scaled unknowns that do not yield: the model's own."""
    lower, upper = program.lbw.copy(), program.ubw.copy()
    for soft in softs:
        if not soft.of_rows:
            lower[soft.where], upper[soft.where] = -np.inf, np.inf
    for layout in program.places.layouts:
        for k, signal in enumerate(layout.phase.signals):
            where = layout.of(k)
            lower[where] = np.maximum(lower[where], signal.min / program.places.scale[where])
            upper[where] = np.minimum(upper[where], signal.max / program.places.scale[where])
    for place, number in zip(program.places.free, program.problem.free, strict=True):
        if number.min == 0.0:
            lower[place] = 0.0
    return lower, upper


def _matrix(column: np.ndarray, value: np.ndarray, shape: tuple[int, int]) -> sparse.csr_matrix:
    """One entry in every row whose column is not negative."""
    row = np.flatnonzero(column >= 0)
    return sparse.csr_matrix((value[row], (row, column[row])), shape=shape)


def _dm(matrix: Any) -> ca.DM:
    columns = matrix.tocsc()
    columns.sort_indices()
    pattern = ca.Sparsity(*matrix.shape, columns.indptr.tolist(), columns.indices.tolist())
    return ca.DM(pattern, columns.data)
