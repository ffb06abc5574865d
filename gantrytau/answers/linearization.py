"""The linear system that a model is close to an operating point: A, B, C, D with exact derivatives.

All equations of index one, R(x, y, u) = 0, are differentiated at the point: x the states, y every other unknown
with its derivatives, u the inputs. Implicit function theorem: dy = -R_y^-1 (R_x dx + R_u du). The rates x' are
among y (or are states), so their rows of dy are A and B; the rows of the outputs are C and D. No closed
form of a block is differentiated, hence no branch and no square root at zero either.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.answers.evaluation import evaluate, given_scalars, named_values
from gantrytau.answers.linear_systems.discretisation import held
from gantrytau.answers.linear_systems.linear_system import LinearSystem
from gantrytau.answers.linear_systems.sample_to_sample import DrivenRows, from_sample_to_sample
from gantrytau.border.checks import number
from gantrytau.border.refusal import Given, InitializationError, ModelError, StructureError, did_you_mean
from gantrytau.compiler.parameters import with_values
from gantrytau.compiler.request import names
from gantrytau.compiler.start.consistency import solve_levels
from gantrytau.compiler.start.level import Level
from gantrytau.compiler.symbol_spaces import column, values_at
from gantrytau.compiler.translated import Translated
from gantrytau.compiler.translation import retranslate, translate_flat, translate_model
from gantrytau.flattening.flat_checks import refuse_events
from gantrytau.language.model import Model
from gantrytau.language.symbols import split_derivative
from gantrytau.simulation.to_result import labels

POOR = 1e6  # condition of the equations, scaled, above which other states are looked for at the point
LEAST_COLUMN = 1e-4  # a column that is smaller is meant to be small
ROUNDING = 1e-9  # of the terms: below, a difference is none
SINGULAR = 1e13  # above this no digit of a solution would be left


@dataclass(frozen=True, eq=False)
class Linearization(LinearSystem):
    """dx' = A dx + B du, dy = C dx + D du about `point`, or from sample to sample with a `period`; prints itself.

    A (n, n), B (n, m), C (k, n), D (k, m), in SI units of the named quantities; states, inputs, outputs: scalar names,
    in the order of rows and columns; point: values of all variables there, by name; period: s, None if continuous;
    units: by name. Poles, responses and figures: see `LinearSystem`.
    """

    model: str
    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    point: Mapping[str, Any] = field(repr=False)
    period: float | None = None
    units: Mapping[str, str] = field(default_factory=dict, repr=False)

    @property
    def title(self) -> str:
        """Title of the linear system in figures and messages."""
        return f"{self.model}, linear" if self.period is None else f"{self.model}, every {self.period:g} s"

    def __str__(self) -> str:
        after = "der({})" if self.period is None else "{} a sample later"
        states, outputs = [after.format(n) for n in self.states], list(self.outputs)
        columns = [*self.states, *self.inputs]
        rows = np.vstack([np.hstack([self.A, self.B]), np.hstack([self.C, self.D])])
        width = max([len(n) for n in (*states, *outputs)], default=0)
        widths = [max(len(n), 11) for n in columns]
        every = "" if self.period is None else f", every {self.period:g} s"
        lines = [
            f"{self.model}, linear about its operating point{every}",
            " " * width + "".join(f"  {n:>{w}}" for n, w in zip(columns, widths, strict=True)),
        ]
        for name, row in zip([*states, *outputs], rows, strict=True):
            cells = "".join(f"  {v:>{w}.5g}" for v, w in zip(row, widths, strict=True))
            lines.append(f"{name:<{width}}{cells}")
        unit = ", 1/s" if self.period is None else ""
        told = zip(self.poles, self.eigenfrequencies, self.damping, strict=True)
        found = (f"{_complex_text(p)} ({f:.4g} Hz, damping {d:.3g})" for p, f, d in told)
        return "\n".join([*lines, f"poles{unit}: {', '.join(found) or 'none'}"])


def _complex_text(value: complex) -> str:
    return f"{value.real:.4g}" if value.imag == 0 else f"{value.real:.4g}{value.imag:+.4g}j"


def linearize(
    model: Model | Translated,
    *,
    at: Mapping[str, Any] | None = None,
    steady: bool = False,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    period: float | None = None,
) -> Linearization:
    """The linear system about an operating point; of a model with `sampled` variables the one from sample to sample.

    at: name -> value, held exactly, the rest is completed from the start values as in `Dae.evaluate`;
    steady: look for a point at rest instead, where every derivative is zero, what is sampled stays, and the values of
    `at` hold: inputs keep their start values if there is one, else those not in `at` are found as well; inputs: names
    (all); outputs: names of any variables and derivatives (the declared ones, else the states); parameters: name ->
    value. period: s, from one instant to the next with inputs held in between (zero-order hold), exactly. A model that
    samples has one of its own, after which all its rates come together; its states are those just before an instant,
    of what moves and of what is held, its outputs those just after it.
    States that cannot be states at the point are replaced by others. Raises InitializationError if there is
    no such point, StructureError if the equations are singular there, ModelError for unknown names, a period that
    does not fit, and a model with whens or laws.
    """
    if period is not None:
        period = number("linearize", "period", period, unit="s", above=0)
    dae = model if isinstance(model, Translated) else translate_model(model)
    refuse_events(dae.flat, "frictions", "delays", "whens", "laws")
    if parameters:
        dae = _with_parameters(dae, parameters)
    columns = dae.inputs if inputs is None else _expanded(dae, "inputs", names(inputs))
    for name in columns:
        if name not in dae.inputs:
            words = f"{name} is not an input of {dae.name}{did_you_mean(name, dae.inputs)}"
            raise ModelError(words, place="inputs", argument="inputs")
    _expanded(dae, "outputs", names(outputs or ()))
    dae = _with_outputs(dae, names(outputs or ()))
    values = _steady(dae, dict(at or {})) if steady else _completed(dae, dict(at or {}))
    linear = _LinearEquations(dae, values)
    if linear.condition > POOR:
        # states are a matter of the point: the height of a pendulum is none at its lowest
        dae = translate_flat(dae.flat, dae.request, values)
        linear = _LinearEquations(dae, values)
    linear.require_regular()
    wanted = names(outputs) if outputs is not None else (dae.outputs or dae.states)
    rows = tuple(n for name in wanted for n in dae.expand(name))
    (A, B, C, D), period = _matrices(dae, linear, rows, columns, period)
    states = (*dae.states, *(s.name for s in dae.flat.sampled))
    # what is held, and not asked for at the next instant, is no state
    kept = [k for k in range(len(A)) if k < len(dae.states) or np.any(A[:, k]) or np.any(C[:, k])]
    matrices = A[np.ix_(kept, kept)], B[kept], C[:, kept], D
    point = named_values(dae, values)
    units, _ = labels(dae)
    names_of_states = tuple(states[k] for k in kept)
    return Linearization(dae.name, *matrices, names_of_states, columns, rows, point, period, units)


def _expanded(dae: Translated, which: str, wanted: Sequence[str]) -> tuple[str, ...]:
    """The scalars of names that are given for an argument; ModelError that names it."""
    try:
        return tuple(n for name in wanted for n in dae.expand(name))
    except ModelError as error:
        refused = error.within(which)
        refused.argument = which
        raise refused from error


def _matrices(
    dae: Translated,
    linear: "_LinearEquations",
    rows: Sequence[str],
    columns: Sequence[str],
    period: float | None,
) -> tuple[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray], float | None]:
    """A, B, C, D for these inputs, continuous, or from sample to sample, and the period."""
    sampled = dae.flat.sampled
    chosen, kept = ([dae.known.index(n) for n in names] for names in (columns, [s.name for s in sampled]))

    def of(expressions: Sequence[ca.SX], words: Sequence[str]) -> DrivenRows:
        by_states, by_known = linear.of(expressions, words)
        return DrivenRows(by_states, by_known[:, kept], by_known[:, chosen])

    rates = of([dae.reduced.chains.rate(n) for n in dae.choice.states], [f"der({n})" for n in dae.states])
    outputs = of([dae.expression(n) for n in rows], rows)
    if sampled:
        updates = of([dae.to_reduced(s.expression) for s in sampled], [s.label for s in sampled])
        periods = [dae.number(s.period) for s in sampled]
        *found, period = from_sample_to_sample(dae.name, rates, updates, outputs, periods, period)
        A, B, C, D = found
        return (A, B, C, D), period
    A, B = (rates.x, rates.u) if period is None else held(rates.x, rates.u, period)
    return (A, B, outputs.x, outputs.u), period


def _with_parameters(dae: Translated, parameters: Mapping[str, Any]) -> Translated:
    _expanded(dae, "parameters", tuple(parameters))
    scalars = given_scalars(dae, parameters)
    for name in scalars:
        if name not in dae.table.symbols:
            words = f"{name} is a variable of {dae.name}; give it in "
            raise ModelError(words, Given("at"), place="parameters", argument="parameters")
    return retranslate(dae, with_values(dae.flat, scalars))


def _with_outputs(dae: Translated, outputs: Sequence[str]) -> Translated:
    """The system with the wanted derivatives among its unknowns."""
    known = {*dae.symbols, *dae.table.symbols, dae.flat.time.name()}
    rows = [n for name in outputs for n in dae.expand(name)]
    if all(leaf.name() in known for n in rows for leaf in ca.symvar(dae.expression(n))):
        return dae
    found = (*dae.request.find, *(n for n in outputs if split_derivative(n)[1]))
    return translate_flat(dae.flat, replace(dae.request, find=found))


def _checked(dae: Translated, at: Mapping[str, Any]) -> dict[str, float]:
    _expanded(dae, "at", tuple(at))
    scalars = given_scalars(dae, at)
    for name in scalars:
        if name in dae.table.symbols:
            words = f"{name} is a parameter of {dae.name}; give it in "
            raise ModelError(words, Given("parameters"), place="at", argument="at")
    return scalars


def _completed(dae: Translated, at: dict[str, Any]) -> dict[str, float]:
    """Numbers of all symbols at the point that `Dae.evaluate` completes."""
    _checked(dae, at)
    found = evaluate(dae, at)
    values = dict(dae.start) | {dae.flat.time.name(): float(at.get(dae.flat.time.name(), 0.0))}
    return values | {n: float(found[n]) for n in dae.symbols if n in found}


def _steady(dae: Translated, at: dict[str, Any]) -> dict[str, float]:
    """Numbers of all symbols at a point where every derivative is zero.

    The equations as they were before differentiation are enough: at rest their derivatives hold too.
    """
    symbols = dae.symbols
    values = dict(dae.start)
    values.update((n, 0.0) for n in symbols if split_derivative(n)[1])
    held = _hold(dae, _checked(dae, at), values)
    still = {dae.reduced.chains.named(n): 0.0 for n in symbols if split_derivative(n)[1]}
    residuals = [dae.indexed.residuals[i, 0] for i in range(len(dae.indexed.counts))]
    residuals += [dae.reduced.chains.named(s.name) - dae.to_reduced(s.expression) for s in dae.flat.sampled]
    if still and residuals:
        rest = ca.vertcat(*residuals)
        residuals = ca.substitute(rest, ca.vertcat(*still), ca.DM(list(still.values()))).elements()
    equations = (*(e.name for e in dae.reduced.equations), *(s.label for s in dae.flat.sampled))
    started = dae.asked.started
    sampled = tuple(s.name for s in dae.flat.sampled)
    free = tuple(n for n in dae.inputs if n not in held)
    title = f"steady state of {dae.name}"
    failures: list[InitializationError] = []
    for unknowns in ((*dae.indexed.orders, *sampled), (*dae.indexed.orders, *sampled, *free)):
        level = Level(tuple(residuals), equations, unknowns)
        try:
            return solve_levels([level], values, held=held, started=started, title=title)
        except InitializationError as error:
            failures.append(error)
    raise InitializationError(
        f"{failures[-1]}. Every derivative is zero there, and {', '.join(at) or 'nothing'} held: hold less in ",
        Given("at"), ", start nearer to a point of rest, or linearize about a motion with ", Given("steady", False),
    )  # fmt: skip


def _hold(dae: Translated, scalars: Mapping[str, float], values: dict[str, float]) -> frozenset[str]:
    """Enter given values; names of the symbols that they fix."""
    held: set[str] = set()
    for name, given in scalars.items():
        if name == dae.flat.time.name():
            values[name] = given
            continue
        alias = dae.root(name)
        if alias is None:
            raise ModelError(f"{name} follows from other variables; give those", place="at", argument="at")
        offset, still = dae.number(alias.offset), alias.root is None or alias.order > 0
        value = given - offset if alias.root is None else dae.number(alias.root_value(given))
        if still and abs(value) > 1e-9 * max(1.0, abs(given)):
            words = f"{name} is {given:g}, but at rest it is {offset:g}; leave it out, or linearize with "
            raise InitializationError(words, Given("steady", False), place="at", argument="at")
        if not still:
            values[alias.symbol] = value
            held.add(alias.symbol)
    return frozenset(held)


class _LinearEquations:
    """All equations of a model, linear at a point, solved for what is no state."""

    def __init__(self, dae: Translated, values: Mapping[str, float]):
        self.dae, self.values = dae, values
        states = set(dae.choice.states)
        chains = dae.reduced.chains
        symbols = dae.symbols
        self.inner = [n for n in dae.indexed.unknown_symbols() if n not in states]
        self.driving = [
            n for n in symbols if split_derivative(n)[0] in dae.reduced.known and n not in dae.known
        ]
        self.x = column([chains.named(n) for n in dae.choice.states])
        self.y = column([chains.named(n) for n in self.inner])
        self.u = column([*(chains.sx(n) for n in dae.known), *(chains.named(n) for n in self.driving)])
        self.keys = list(dae.indexed.residuals)
        residuals = column([dae.indexed.residuals[k] for k in self.keys])
        R_x, R_y, R_u = (self._numbers(ca.jacobian(residuals, v)) for v in (self.x, self.y, self.u))
        self.matrix, rows, columns = _scaled(R_y, np.hstack([R_x, R_y, R_u]))
        self.condition = _condition(self.matrix)
        right = np.hstack([R_x, R_u]) / rows[:, None]
        self.rates = -_solve(self.matrix, right) / columns[:, None] if self.condition < SINGULAR else None

    def _numbers(self, matrix: ca.SX) -> np.ndarray:
        found = values_at(matrix, self.values)
        if not np.all(np.isfinite(found)):
            raise StructureError(
                f"{self.dae.name}: the derivatives of its equations are not finite at the operating point; choose a point "
                "beside it"
            )
        return found

    def require_regular(self) -> None:
        """StructureError where the algebraic equations determine nothing."""
        if self.rates is not None:
            return
        left, _, right = np.linalg.svd(self.matrix)
        weak = [self.dae.equation_name(self.keys[i]) for i in _largest(left[:, -1])]
        free = [self.inner[j] for j in _largest(right[-1])]
        raise StructureError(
            f"{self.dae.name}: its equations are singular at the operating point: {'; '.join(weak)} do not determine "
            f"{', '.join(free)}. Expected regular algebraic equations: choose a point beside it"
        )

    def of(self, expressions: Sequence[ca.SX], rows: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of expressions by the states and by the inputs; StructureError where inputs' rates enter."""
        n, m = self.x.numel(), len(self.dae.known)
        vector = column(list(expressions))
        direct, through = ca.jacobian(vector, ca.vertcat(self.x, self.u)), ca.jacobian(vector, self.y)
        assert self.rates is not None
        first, then = self._numbers(direct), self._numbers(through)
        total = first + then @ self.rates
        terms = np.abs(first) + np.abs(then) @ np.abs(self.rates)
        extra = np.abs(total[:, n + m :]) - ROUNDING * terms.max(axis=1, keepdims=True, initial=0.0)
        if np.any(extra > 0):
            i, j = divmod(int(np.argmax(extra)), extra.shape[1])
            raise StructureError(
                f"{self.dae.name}: {rows[i]} depends on {self.driving[j]}, the derivative of an input, which A, B, C, D "
                "cannot say; pass the input through a filter, or translate with another given="
            )
        return total[:, :n], total[:, n : n + m]


def _scaled(matrix: np.ndarray, whole: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The matrix with rows, then columns, brought to about size one, and the divisors; units count little then.

    whole: the same rows with all columns: a row that hangs on the states alone must not be blown up.
    """
    if matrix.size == 0:
        return matrix, np.ones(matrix.shape[0]), np.ones(matrix.shape[1])
    rows = np.abs(whole).max(axis=1)
    rows[rows == 0] = 1.0
    inside = matrix / rows[:, None]
    columns = np.maximum(np.abs(inside).max(axis=0), LEAST_COLUMN)
    return inside / columns, rows, columns


def _condition(matrix: np.ndarray) -> float:
    return float(np.linalg.cond(matrix)) if matrix.size else 1.0


def _solve(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    return np.linalg.solve(matrix, right) if matrix.size else right


def _largest(shares: np.ndarray) -> list[int]:
    sizes = np.abs(shares)
    return [int(i) for i in np.argsort(-sizes)[:4] if sizes[i] > 0.3 * sizes.max()]
