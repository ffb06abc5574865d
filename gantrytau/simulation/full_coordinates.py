"""The model with all its coordinates as states, for the integrator, and the constraints they must keep."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.border.refusal import SolveError
from gantrytau.compiler.start.consistent_start import consistent_start
from gantrytau.compiler.start.start_values import StartValues
from gantrytau.compiler.symbol_spaces import Substitution
from gantrytau.compiler.translated import Translated
from gantrytau.language.symbols import derivative_name, time
from gantrytau.simulation.events.at_places import AtPlaces
from gantrytau.simulation.events.margins import Switches
from gantrytau.simulation.events.modes import InModes
from gantrytau.simulation.events.rounds import Rounds
from gantrytau.simulation.events.sticking import Slips, slips_of
from gantrytau.simulation.memory.hermite import ORDER
from gantrytau.simulation.memory.rates_along import RatesAlong
from gantrytau.simulation.singular_poses import Conditioning, Point, depending

LARGEST_DRIFT = 1e-12  # of a constraint relative to its terms, above which a point is projected
STEPS = 10
STALLED = 1e-6  # of the largest one: smaller Newton steps that do not shrink are rounding
ROUNDING = 4 * np.finfo(float).eps  # of the largest algebraic variable
LEAST = 1e-3  # of its size, that a coordinate counts in a constraint
FUNCTIONS = "daeF", "jacF"  # of an integrator: rates with residuals, and their Jacobians
OPEN = 1e-6  # of the size of a loop, by which a constraint that was left out may be violated


@dataclass(frozen=True, eq=False)
class Coordinates:
    """x' = ode(t, x, z, w), 0 = algebraic; invariants(t, x, w) are levels that must stay zero,
    rows the names of their equations.

    states: names of x, every derivative below the highest; sampled: inputs given by samples; held: variables
    that the model samples; known: expression of each known symbol in time and w
    (values of the sampled inputs, their slopes, values of the held variables, of the discretes, modes of the switches);
    substitutions: all symbols in terms of (t, x, z, w), one after the other; pieces: the equations with modes; renewal:
    what the held variables become at an instant; rounds: what whens do; sizes: typical magnitudes of the states, powers
    of two; all 1 if there are none.
    """

    dae: Translated
    states: tuple[str, ...]
    algebraics: tuple[str, ...]
    sampled: tuple[str, ...]
    held: tuple[str, ...]
    x: ca.SX
    z: ca.SX
    w: ca.SX
    t0: ca.SX
    ode: ca.SX
    algebraic: ca.SX
    invariants: tuple[ca.SX, ...]
    rows: tuple[tuple[str, ...], ...]
    known: Mapping[str, ca.SX]
    substitutions: tuple[Substitution, ...]
    pivots: ca.SX
    pieces: InModes
    switches: Switches
    rounds: Rounds
    dropped: ca.Function
    renewal: ca.SX
    conditioning: Conditioning
    sizes: tuple[float, ...] = ()

    @property
    def arguments(self) -> list[ca.SX]:
        """Symbols of a point."""
        return [self.x, self.z, time, self.t0, self.w]

    @property
    def discretes(self) -> tuple[str, ...]:
        """Variables that whens set, which are held as well."""
        return self.dae.flat.discretes

    @property
    def constrained(self) -> bool:
        """Whether there are constraints to hold."""
        return any(level.numel() for level in self.invariants)

    @property
    def stepwise(self) -> bool:
        """Whether there are signals that are known interval by interval."""
        return bool(self.sampled or self.held or self.discretes or self.dae.flat.delays or len(self.switches))

    @property
    def curved(self) -> bool:
        """Whether rates depend on states other than linearly."""
        return self.kept("curved", self._curved)

    def _curved(self) -> bool:
        moving, unknown = ca.vertcat(self.ode, self.algebraic), ca.vertcat(self.x, self.z)
        return ca.depends_on(ca.jacobian(moving, unknown), unknown)

    @property
    def idle(self) -> np.ndarray:
        """Which of what is held, (k,) as in a trail, neither motions nor margins depend on."""
        return self.kept("idle", self._idle)

    def _idle(self) -> np.ndarray:
        moving = ca.vertcat(
            self.ode, self.algebraic, *self.invariants, self.switches.margins, self.rounds.past
        )
        own = self.w[2 * len(self.sampled) :]
        return ~np.array(ca.which_depends(moving, own, 1, False), dtype=bool)

    @property
    def delay_columns(self) -> slice:
        """Where the coefficients of delayed values, six of each, stand in what is held."""
        first = len(self.held) + len(self.discretes)
        return slice(first, first + (ORDER + 1) * len(self.dae.flat.delays))

    @cached_property
    def delayed(self) -> RatesAlong:
        """Delayed expressions and their rates."""
        return RatesAlong(self.rounds.past, self.arguments, self.ode, self.algebraic)

    def integrator(
        self,
        count: int,
        tolerance: float,
        *,
        size: float = 1.0,
        steps: int = 100_000,
        modes: Sequence[float] = (),
        longest: float | None = None,
        functions: Mapping[str, ca.Function] | None = None,
    ) -> ca.Function:
        """An integrator over `count` intervals in the scaled time 0..count.

        size: of algebraics, which need not be more exact than `tolerance` of it; steps: at most, to one end; modes: what
        it is made for, so that nothing is left of other pieces (a root that they have may have no derivative), else any.
        Its states are in units of their sizes. longest: step, in intervals. functions: its own of FUNCTIONS, made before.

        p = (start, interval) in s; if the model is stepwise, per interval u = (start, length, number, w) instead: the
        intervals may differ then.
        """
        tau = ca.SX.sym("tau")
        if self.stepwise:
            u = ca.SX.sym("u", 3 + self.w.numel())
            t, h, w, p = u[0] + u[1] * (tau - u[2]), u[1], u[3:], ca.SX(0, 1)
            begin = u[0]
        else:
            p, u, w = ca.SX.sym("p", 2), ca.SX(0, 1), ca.SX(0, 1)
            t, h, begin = p[0] + p[1] * tau, p[1], p[0]
        old = ca.vertcat(time, self.t0, self.w)
        new = ca.vertcat(t, begin, w)
        own = self.w[self.w.numel() - len(modes) :]
        equations = ca.substitute([self.ode, self.algebraic], [own], [ca.SX(ca.DM(modes))]) if modes else None
        rates, rest = equations or (self.ode, self.algebraic)
        if any(one != 1 for one in self.sizes):
            scale = ca.SX(ca.DM(self.sizes))
            rates, rest = ca.substitute([rates / scale, rest], [self.x], [self.x * scale])
        ode, algebraic = ca.cse(ca.substitute([h * rates, rest], [old], [new]))
        # an integrator needs a state: a model without one gets a constant
        x, ode = (self.x, ode) if self.states else (ca.SX.sym("nothing"), ca.SX(0))
        problem = {"t": tau, "x": x, "p": p, "u": u, "ode": ode}
        options: dict[str, Any] = {
            "abstol": tolerance,
            "reltol": tolerance,
            "max_num_steps": steps,
            "disable_internal_warnings": True,
            "show_eval_warnings": False,
            "linear_solver": "csparse",  # the QR of CasADi fails by entries whose squares are no numbers
            "cache": dict(functions or {}),
        }
        if longest is not None and np.isfinite(longest):
            options["max_step_size"] = longest
        if self.algebraics:
            problem |= {"z": self.z, "alg": algebraic}
            if size > 1:
                options["abstolv"] = [tolerance] * x.numel() + [tolerance * size] * self.z.numel()
            options["suppress_algebraic"] = True  # forces need not be as smooth as positions: half the steps
        method = "idas" if self.algebraics else "cvodes"
        return ca.integrator("simulate", method, problem, 0.0, list(range(1, count + 1)), options)

    def function(self, name: str, make: Callable[[], Sequence[ca.SX]]) -> ca.Function:
        """(x, z, time, t0, w) -> dense expressions, made once for a name."""
        return self.kept(
            ("function", name),
            lambda: ca.Function(name, self.arguments, [ca.densify(e) for e in make()], {"cse": True}),
        )

    @property
    def renewed(self) -> ca.Function:
        """The renewal as a function."""
        return self.function("renewed", lambda: [self.renewal])

    @property
    def rates(self) -> AtPlaces:
        """X' at places."""
        return self.kept("rates", lambda: AtPlaces(self.function("rates", lambda: [self.ode])))

    def inserted(self, expressions: Sequence[ca.SX]) -> list[ca.SX]:
        """Expressions of reduced symbols in terms of (t, x, z, w)."""
        found = list(expressions)
        for substitution in self.substitutions:
            found = substitution.inserted(found)
        return found

    @cached_property
    def made(self) -> dict[Hashable, Any]:
        """Functions that were made of it, by what they are for; the same for all sizes."""
        return {}

    def kept(self, key: Hashable, make: Callable[[], Any]) -> Any:
        """Cached object of a key, made at its first use."""
        if key not in self.made:
            self.made[key] = make()
        return self.made[key]

    def sized(self, sizes: tuple[float, ...]) -> "Coordinates":
        """These coordinates with other sizes of the states, for a new run."""
        found = replace(self, sizes=sizes, conditioning=self.conditioning.anew())
        found.__dict__["made"] = self.made
        return found

    def start(self, t: float, w: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Consistent states and algebraics at the start, with the inputs as they are then; delays, and modes."""
        dae = self.dae
        known = ca.vertcat(*self.known.values())
        at = self.kept("known", lambda: ca.Function("known", [time, self.t0, self.w], [known]))
        values = {**dae.start, time.name(): t}
        if self.known:
            values.update(zip(self.known, np.array(at(t, t, w)).ravel().tolist(), strict=True))
        there = t, *(values[n] for n in self.known)
        found = self.kept(("start", there), lambda: self._consistent(values))
        x = np.array([found[n] for n in self.states])
        modes = self.pieces.numbers({**found, time.name(): t})
        past = [c for d in dae.flat.delays for c in (found[d.name], *np.zeros(ORDER))]
        own = np.array([*past, *(modes[turn.mode.name()] for turn in self.switches.turns)])
        return x, np.array([found[n] for n in self.algebraics]), own

    def _consistent(self, values: dict[str, float]) -> dict[str, float]:
        dae = self.dae
        guess = StartValues(values, dae.asked.started | frozenset(self.known), dae.asked.fixed)
        return consistent_start(dae.flat, dae.reduced, dae.indexed, guess)

    def not_finite(self, point: Point, step: float) -> list[str]:
        """Names of what has no finite value at a point, or where its rates lead within a time, s."""
        function = self.function("moves", lambda: [self.ode, self.algebraic])
        x, z, t, w = point
        rates = np.array(function(x, z, t, t, w)[0]).ravel()
        for share in (0.0, 1e-6, 1e-3, 1.0):
            there = x + share * step * np.nan_to_num(rates)
            found = [np.array(f).ravel() for f in function(there, z, t + share * step, t, w)]
            names = [*(derivative_name(n, 1) for n in self.states), *self.algebraics]
            bad = np.flatnonzero(~np.isfinite(np.concatenate(found)))
            if bad.size:
                return [self.dae.spoken(names[k]) for k in bad]
        return []

    @property
    def slips(self) -> Slips:
        """The frictions that may stick."""
        return self.kept("slips", self._made_slips)

    def _made_slips(self) -> Slips:
        constraints = self.invariants[-1] if self.invariants else ca.SX(0, 1)
        first = 2 * len(self.sampled) + len(self.held)
        return slips_of(self.dae, self.inserted, self.arguments, constraints, first)

    @property
    def _levels(self) -> list[tuple[list[int], AtPlaces, tuple[str, ...]]]:
        return self.kept("levels", self._made_levels)

    def _made_levels(self) -> list[tuple[list[int], AtPlaces, tuple[str, ...]]]:
        """Each level: its columns, the function to its residual and Jacobian, the names of its rows."""
        found = []
        positions = {n: k for k, n in enumerate(self.states)}
        for stage, residual in enumerate(self.invariants, start=-len(self.invariants)):
            own = {leaf.name() for leaf in ca.symvar(residual)}
            tops = self.dae.indexed.orders.items()
            level = [derivative_name(n, stage + top) for n, top in tops if stage + top >= 0]
            columns = [positions[n] for n in level if n in own and n in positions]
            if not columns:
                continue
            x = self.x[columns]
            jacobian = ca.densify(ca.jacobian(residual, x))
            arguments = [self.x, time, self.t0, self.w]
            function = ca.Function("level", arguments, [ca.densify(residual), jacobian], {"cse": True})
            found.append((columns, AtPlaces(function), self.rows[stage]))
        return found

    def project(self, x: np.ndarray, t: np.ndarray, w: np.ndarray) -> np.ndarray:
        """The nearest points that satisfy all constraints, (points, n), with what sticks at rest; SolveError where there is
        none near.

        x: (points, n); t: (points,); w: (points, m).
        """
        x, least = x.copy(), LEAST * np.array(self.sizes or [1.0] * len(self.states))
        size = 0.0  # of the first level, positions: at rest the others say nothing
        for columns, level, _ in self._levels:
            worst = np.zeros(len(x))
            for _ in range(STEPS):
                residual, jacobian = level(x, t, t, w)
                jacobian = jacobian.reshape(len(x), len(columns), -1).transpose(0, 2, 1)
                size = size or min(1.0, float(np.abs(x[:, columns]).max(initial=0.0))) or 1.0
                terms = np.maximum(np.abs(x[:, columns]), size * least[columns])
                scale = np.einsum("kij,kj->ki", np.abs(jacobian), terms)
                worst = np.max(np.abs(residual) / scale, axis=1)
                if not np.any(worst > LARGEST_DRIFT):
                    break
                x[:, columns] -= _shortest(jacobian, residual)
            lost = np.flatnonzero(~(worst <= 1e-8))
            if lost.size:
                when = float(t[lost[0]])
                raise SolveError(
                    f"{self.dae.name}: the constraints cannot be met at t = {when:.6g} s", time=when
                )
        return self.slips.held(x, t, w) if self.dae.flat.slips else x

    def followed(self, x: np.ndarray, t: float, w: np.ndarray) -> np.ndarray:
        """A point, (n,), at which the states of the model are those of x, and what follows from them by constraints is such
        that all hold; SolveError where there is none.
        """
        x, own = x.copy(), set(self.dae.choice.states)
        for columns, level, names in self._levels:
            free = [k for k, c in enumerate(columns) if self.states[c] not in own]
            for _ in range(STEPS):
                residual, jacobian = (np.array(m) for m in level.function(x, t, t, w))
                scale = np.abs(jacobian) @ np.maximum(np.abs(x[columns]), LEAST)
                if np.all(np.abs(residual.ravel()) <= LARGEST_DRIFT * scale):
                    break
                step = np.linalg.lstsq(jacobian[:, free], residual.ravel(), rcond=1e-12)[0]
                x[np.array(columns)[free]] -= step
            else:
                raise SolveError(f"the constraints {'; '.join(names[:4])} cannot be met", time=t)
        return x

    def opened(self, x: np.ndarray, t: np.ndarray, w: np.ndarray) -> tuple[int, str] | None:
        """The first point at which a constraint that was left out as redundant does not hold, and its name."""
        if not self.dae.redundant:
            return None
        residual = np.array(self.dropped(x.T, t[None], t[None], w.T)).reshape(len(self.dae.redundant), len(x))
        bad = np.flatnonzero(~(np.abs(residual).max(axis=0) <= OPEN))
        if not bad.size:
            return None
        return int(bad[0]), self.dae.redundant[int(np.argmax(np.abs(residual[:, bad[0]])))].name

    def settle(self, x: np.ndarray, z: np.ndarray, t: np.ndarray, w: np.ndarray) -> np.ndarray:
        """The algebraic variables that belong to points, (points, m): the integrator does not see to their errors."""
        before: Any = np.inf
        for _ in range(STEPS if self.algebraics else 0):
            residual, jacobian = self._algebra(x, z, t, t, w)
            jacobian = jacobian.reshape(len(x), z.shape[1], -1).transpose(0, 2, 1)
            try:
                step = np.linalg.solve(jacobian, residual[:, :, None])[:, :, 0]
            except np.linalg.LinAlgError:
                return z
            if not np.all(np.isfinite(step)):
                return z
            z = z - step
            size, largest = np.abs(step), np.abs(z).max(axis=1, keepdims=True)
            settled = size <= np.maximum(LARGEST_DRIFT * np.abs(z), ROUNDING * largest)
            near = np.all(size <= STALLED * largest)
            if np.all(settled | (near & (size > before / 2))):
                return z  # found, or no better for rounding
            before = size
        return z

    @property
    def _algebra(self) -> AtPlaces:
        parts = "algebra", lambda: [self.algebraic, ca.jacobian(self.algebraic, self.z)]
        return self.kept("algebra", lambda: AtPlaces(self.function(*parts)))

    def weakest(self, point: Point, start: Point) -> list[str]:
        """Names of the equations that nearly depend on each other at a point, if they did not at the start.

        The constraints are asked first: where they are sound, all equations of the accelerations are.
        """
        for _, level, names in self._levels:
            here, before = (np.array(level.function(x, t, t, w)[1]) for x, _, t, w in (point, start))
            found = depending(here, before, names)
            if found:
                return found
        if self.pivots.numel() == 0:
            return []
        function = self.function("pivots", lambda: [self.pivots])
        here, before = (np.array(function(x, z, t, t, w)) for x, z, t, w in (point, start))
        return depending(here, before, [e.name for e in self.dae.reduced.equations])


def _shortest(jacobian: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """The shortest steps d with jacobian d = residual, (points, n)."""
    square = jacobian @ jacobian.transpose(0, 2, 1)
    try:
        return (jacobian.transpose(0, 2, 1) @ np.linalg.solve(square, residual[:, :, None]))[:, :, 0]
    except np.linalg.LinAlgError:
        pairs = zip(jacobian, residual, strict=True)
        return np.array([np.linalg.lstsq(j, r, rcond=1e-12)[0] for j, r in pairs])
