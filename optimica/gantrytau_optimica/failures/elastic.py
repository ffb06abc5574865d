"""The program in which limits and conditions may yield, at a price, while the model holds, for Ipopt.

    minimise    sum over conditions of price * s
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

from gantrytau_optimica.control.limits import bare_limit
from gantrytau_optimica.failures.constraint_labels import row_sizes
from gantrytau_optimica.solving.clock import Clock
from gantrytau_optimica.solving.interruptible import Watch, attended
from gantrytau_optimica.transcription.assemble import to_dm
from gantrytau_optimica.transcription.program import Program

START = 2.0  # price of a start against other conditions: it is a fact more often than a wish
# by which what is written later is cheaper, so that of two equals one gives way, not both by half
LATER = 0.02
PATIENCE = 5.0  # s of waiting for a second of computing: other programs take their share
LINKS = (" begins where ", " begins when ")  # conditions between phases belong to the model


@dataclass(frozen=True, eq=False)
class Soft:
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


def soft_conditions(program: Program, w: np.ndarray) -> list[Soft]:
    """All that may yield, in the order in which it is written."""
    sizes = row_sizes(program, w)
    found = [
        Soft(
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
                where, never = np.array([place]), np.array([np.nan])
                found.append(Soft(name, False, where, low, high, scale, scale, 1.0, never, -1, limit))
    count = max(len(found) - 1, 1)
    return [
        replace(s, price=(START if _is_start(s.name) else 1.0) * (1 - LATER * k / count))
        for k, s in enumerate(found)
    ]


def _is_start(name: str) -> bool:
    return name.startswith(("initial(", "initial equation"))


def _soft_signals(program: Program) -> Iterator[Soft]:
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
            yield Soft(name, False, where, low, high, size, size, 1.0, moments, number)


class Elastic:
    """The relaxed program for Ipopt; which conditions may yield is said at each solve."""

    def __init__(self, program: Program, softs: Sequence[Soft]):
        self.program, self.softs = program, softs
        assembled, places = program.assembled, program.places
        hard = np.setdiff1d(
            np.arange(assembled.rows),
            np.concatenate([np.zeros(0, int), *(s.where for s in softs if s.of_rows)]),
        )
        select, pick, give = [hard], [np.full(hard.size, -1)], [np.zeros(hard.size)]
        low, high = [program.lbg[hard]], [program.ubg[hard]]
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
        select, pick, yielding = to_dm(self.select), to_dm(self.pick), to_dm(self.yielding)
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
        left = end - time.process_time()
        if left < 0.05:
            return None
        nlp, derivatives = self.functions
        m = len(self.softs)
        watch = Watch(self.size + m, self.rows)
        quiet = {"print_time": False, "calc_lam_p": False, "show_eval_warnings": False}
        ipopt = {"print_level": 0, "sb": "yes", "mu_strategy": "adaptive", "tol": 1e-8, "max_iter": 500}
        options = quiet | derivatives | {"iteration_callback": watch, "ipopt": ipopt | {"max_cpu_time": left}}
        solver = ca.nlpsol("relaxed", "ipopt", nlp, options)
        most = np.zeros(m)
        most[list(which)] = [self.softs[k].most / self.softs[k].size for k in which]
        scaled = start / self.program.places.scale
        watch.begin(Clock(PATIENCE * left))
        first = np.concatenate([scaled, self._needed(scaled)])
        limits = dict(lbx=np.append(self.lbw, np.zeros(m)), ubx=np.append(self.ubw, most))
        found = attended(solver, watch, dict(x0=first, lbg=self.low, ubg=self.high, **limits))
        if watch.pressed:
            raise KeyboardInterrupt
        if found is None or not solver.stats()["success"]:
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


def _hard_bounds(program: Program, softs: Sequence[Soft]) -> tuple[np.ndarray, np.ndarray]:
    """Limits of the scaled unknowns that do not yield: the model's own."""
    lower, upper = program.lbw.copy(), program.ubw.copy()
    for soft in softs:
        if not soft.of_rows:
            lower[soft.where], upper[soft.where] = -np.inf, np.inf
    for layout, phase in zip(program.places.layouts, program.problem.phases, strict=True):
        for k, signal in enumerate(phase.signals):
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
