"""The flat model in Base Modelica: declarations, initial equations, equations and whens of one model.

Names are quoted identifiers, `'carts[0].s'`, so that every name of the model is one name there. What is known
of the Dae is `input`. Derivatives of higher order get variables of their own, `'=der(x)' = der('x')`; so do
propagated quantities and large subexpressions that occur more than once. The text has as many equations as
unknowns, and none that follows from others: a constraint that would is replaced by `force = 0`. Modelica
Language Specification 3.6, chapters 2, 3 and 8; Modelica Change Proposal MCP-0031, Base Modelica.
"""

from dataclasses import replace

import casadi as ca
import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.compiler.translated import Translated
from gantrytau.flattening.flat_checks import refuse_events
from gantrytau.flattening.flat_model import FlatParameter, FlatVariable
from gantrytau.language.declarations import StateSelect
from gantrytau.language.statements import Equation
from gantrytau.language.symbols import derivative_name, split_derivative
from gantrytau.writing.graph import Graph, Node, expressions
from gantrytau.writing.modelica_syntax import quoted, string
from gantrytau.writing.subexpressions import Text, located, worth_a_name, written, written_at
from gantrytau.writing.syntax import CHOICE, Written, ordered, write
from gantrytau.writing.text import friction_lines
from gantrytau.writing.when_equations import WhenEquations

SELECT = {
    StateSelect.NEVER: "never", StateSelect.AVOID: "avoid",
    StateSelect.PREFER: "prefer", StateSelect.ALWAYS: "always",
}  # fmt: skip
NO_FORCE = "no force for "  # begins the name of the equation that stands for a redundant constraint
MOVED = 1e-12  # share of a start value from which it has been moved, not rounded
LEAST_SAVING = 40  # nodes; each name is one more unknown for the tool that reads the text


def base_modelica_text(dae: Translated) -> str:
    """The flat model in Base Modelica; ModelError for a function that Modelica does not have."""
    return _Writer(dae).text()


def independent_equations(dae: Translated) -> list[Equation]:
    """The equations of the flat model, as many as unknowns; those that repeat others are gone, their forces zero."""
    # a redundant constraint leaves its force undetermined; what became 0 == 0 leaves nothing behind
    idle = {id(e) for e in dae.redundant}
    gone = {id(e) for e in dae.reduced.redundant}
    symbols = {n: s for v in dae.flat.variables for n, s in zip(v.elements, v.symbol.elements(), strict=True)}
    unforced = {e.dual for e in dae.reduced.redundant if e.label.startswith(NO_FORCE)}
    found: list[Equation] = []
    for equation in dae.flat.equations:
        if id(equation) not in idle:
            found += [] if id(equation) in gone else [equation]
        elif equation.dual not in unforced:
            label = f"{NO_FORCE}{equation.name}"
            found.append(replace(equation, left=symbols[equation.dual], right=ca.SX(0), label=label))
    return found


class _Writer:
    def __init__(self, dae: Translated):
        refuse_events(dae.flat, "laws")
        self.dae, self.flat, self.graph = dae, dae.flat, Graph()
        self.equations = independent_equations(dae)
        self.auxiliaries: list[str] = []
        wanted = [n for name in dae.request.find for n in self.flat.expand(name) if n.startswith("der(")]
        self.wanted = [n for n in dict.fromkeys(wanted) if n not in self.flat.derivatives]
        on_instants = (*self.flat.sampled, *self.flat.whens, *self.flat.delays)
        self.orders = self._orders([e for one in on_instants for _, e in one.sides])
        self.whens = WhenEquations(self.flat, self.graph, LEAST_SAVING)
        self.syntax = self.whens.syntax
        self.starts = self._starts()

    def _starts(self) -> dict[str, ca.SX]:
        """Start values that were moved, as they were found: who reads the text does not have to move them another way."""
        started = [v for v in self.flat.variables if v.start is not None and not v.fixed]
        names = [n for v in started for n in v.elements]
        asked = [x for v in started for x in self.dae.table.numbers(ca.vertcat(*(v.start or ()))).tolist()]
        found = self.dae.numbers(names, self.dae.start).tolist() if names else []
        known = set(self.dae.known)
        rows = zip(names, asked, found, strict=True)
        return {
            n: ca.SX(f) for n, a, f in rows if abs(f - a) > MOVED * max(abs(a), abs(f)) and n not in known
        }

    def _orders(self, used: list[ca.SX]) -> dict[str, int]:
        """The highest derivative of each variable that the text needs; used: what it needs beside equations."""
        found: dict[str, int] = {}
        used += [side for e in (*self.equations, *self.flat.initial_equations) for side in (e.left, e.right)]
        for leaf in ca.symvar(ca.SX(ca.vertcat(*used, *self.flat.definitions.values()))):
            name, order = split_derivative(leaf.name())
            found[name] = max(order, found.get(name, 0))
        for name, order in map(split_derivative, self.wanted):
            found[name] = max(order, found.get(name, 0))
        return found

    def text(self) -> str:
        sections = self._equations()  # first: they decide which variables there are
        name = quoted(self.flat.name)
        lines = [f"model {name} {string('flat equations of ' + self.flat.name)}"]
        lines += [self._parameter(p, k) for p in self.flat.parameters for k in range(len(p.elements))]
        known = set(self.dae.known)
        places = [(v, k) for v in self.flat.variables for k in range(len(v.elements))]
        lines += [self._variable(v, k, known) for v, k in places if v.elements[k] not in self.whens.spoken]
        lines += [*self.auxiliaries, *self.whens.declared]
        around = ["//! base 3.6.0", f"package {name}"]
        return "\n".join([*around, *lines, *sections, f"end {name};", f"end {name};"]) + "\n"

    def _equations(self) -> list[str]:
        """The sections of equations; on the way, the declarations of auxiliary variables are collected."""
        equations = [*self.equations, *self.flat.initial_equations]
        try:
            propagated = self._propagated()
            sides = self.graph.read(side for e in equations for side in (e.left, e.right))
            named: dict[Node, Written] = {}
            for name, node in propagated.items():
                if not node.leaf:
                    named.setdefault(node, Written(quoted(name)))
            roots = [*sides, *propagated.values()]
            text = written(roots, self.syntax, named, saving=LEAST_SAVING)
            self._start_shared(worth_a_name(roots, named, LEAST_SAVING))
        except ModelError:
            for equation in equations:  # one of them is at fault, and is named
                written_at(equation.name, [equation.left, equation.right], self.syntax)
            raise
        lines = [self._equation(e, *text.expressions[2 * k : 2 * k + 2]) for k, e in enumerate(equations)]
        own, initial = lines[: len(self.equations)], lines[len(self.equations) :]
        found = ["initial equation", *initial] if initial else []
        found += ["equation", *own, *self._derivatives(), *self._named(propagated, text, len(sides))]
        return [*found, *self.whens.lines(), *self._asserted(), *self._left_out()]

    def _start_shared(self, nodes: list[Node]) -> None:
        """Start values of shared subexpressions, without which an iteration may begin where they are not defined."""
        made = expressions(ordered(nodes))
        values = ca.SX(ca.vertcat(*(made[node] for node in nodes)))
        leaves = ca.symvar(values)
        names = [leaf.name() for leaf in leaves]
        known = {**self.dae.table.values, "time": 0.0}
        others = [n for n in names if n not in known]
        known |= dict(zip(others, self.dae.numbers(others, self.dae.start) if others else (), strict=True))
        found = ca.Function("starts", [ca.vertcat(*leaves)], [values])(ca.DM([known[n] for n in names]))
        for number, value in enumerate(np.array(found).ravel(), start=1):
            if np.isfinite(value):
                self.starts[self.syntax.shared(number).text] = ca.SX(value)

    def _propagated(self) -> dict[str, Node]:
        nodes = self.graph.read(self.flat.definitions.values())
        return dict(zip(self.flat.definitions, nodes, strict=True)) | self.whens.aside

    def _equation(self, equation: Equation, left: Written, right: Written) -> str:
        # an `if` may stand on the right only
        side = f"({left.text})" if left.level == CHOICE else left.text
        return f"  {side} = {right.text} {string(equation.name)};"

    def _derivatives(self) -> list[str]:
        """One equation for each derivative that is differentiated again, or asked for."""
        found: list[str] = []
        for name, top in self.orders.items():
            for order in range(1, top):
                new, old = derivative_name(name, order), derivative_name(name, order - 1)
                words = "" if order == 1 else f"derivative {order} of {name}"
                variable = self.syntax.variable(new)
                self.auxiliaries.append(f"  Real {variable} {string(words or f'derivative of {name}')};")
                found.append(f"  {variable} = der({self.syntax.variable(old)});")
        for new in self.wanted:
            self.auxiliaries.append(f"  output Real {quoted(f'=wanted {new}')};")
            found.append(f"  {quoted(f'=wanted {new}')} = {self.syntax.symbol(new).text};")
        return found

    def _named(self, propagated: dict[str, Node], text: Text, start: int) -> list[str]:
        """Equations of shared subexpressions and propagated quantities."""
        own = dict(text.definitions)
        for name, expression in zip(propagated, text.expressions[start:], strict=True):
            own.setdefault(quoted(name), expression.text)
        declared = {quoted(n): (v, k) for v in self.flat.propagated for k, n in enumerate(v.elements)}
        constant = {quoted(name) for name, node in propagated.items() if node.operation == "number"}
        for name, expression in own.items():
            if name in constant:
                self.auxiliaries.append(self._declare("constant ", *declared[name], expression))
            elif name in declared:
                self.auxiliaries.append(self._declare("", *declared[name]))
            else:
                guess = f"(start={self._expression(name, self.starts[name])})" if name in self.starts else ""
                self.auxiliaries.append(f'  Real {name}{guess} "shared subexpression";')
        return [f"  {name} = {expression};" for name, expression in own.items() if name not in constant]

    def _asserted(self) -> list[str]:
        """What parameters must satisfy, and the ends of tables that are not defined beyond."""
        found = [(ca.SX(one.condition), one.message) for one in self.flat.requirements]
        found += [
            (ca.logic_and(r.low <= r.expression, r.expression <= r.high), r.left) for r in self.flat.ranges
        ]
        conditions = [self.graph.truth(*self.graph.read([condition])) for condition, _ in found]
        texts = write(conditions, self.syntax, {})
        pairs = zip(conditions, found, strict=True)
        return [f"  assert({texts[node].text}, {string(words)});" for node, (_, words) in pairs]

    def _left_out(self) -> list[str]:
        redundant = (*self.dae.redundant, *self.dae.reduced.redundant)
        left_out = [f"  // left out, it follows from the others: {e.name}" for e in redundant]
        return [
            *left_out,
            *(f"  // an input here, in the model {line}" for line in friction_lines(self.flat)),
        ]

    def _parameter(self, parameter: FlatParameter, k: int) -> str:
        value = self._expression(parameter.elements[k], parameter.value[k])
        return self._declare(
            "parameter ", parameter, k, value, " annotation(Evaluate=true)" if parameter.fold else ""
        )

    def _variable(self, variable: FlatVariable, k: int, known: set[str]) -> str:
        held = variable.elements[k] in self.whens.held
        prefix = "output " if variable.kind == "output" else ""
        if variable.elements[k] in known and not held:
            prefix = "input "
        return self._declare("discrete " + prefix if held else prefix, variable, k)

    def _declare(self, prefix: str, variable: FlatVariable, k: int, value: str = "", end: str = "") -> str:
        comment = f" {string(variable.description)}" if variable.description else ""
        binding = f" = {value}" if value else ""
        attributes = self._attributes(variable, k)
        return f"  {prefix}Real {quoted(variable.elements[k])}{attributes}{binding}{comment}{end};"

    def _attributes(self, variable: FlatVariable, k: int) -> str:
        found = [] if variable.unit is None else [f"unit={string(variable.unit)}"]
        passed_on = variable.kind == "propagated"  # it has an equation of its own, and needs no start
        for key in ("min", "max", "nominal") if passed_on else ("min", "max", "start", "nominal"):
            values = getattr(variable, key)
            if values is None or (values[k].is_constant() and abs(float(values[k])) == float("inf")):
                continue
            value = self.starts.get(variable.elements[k], values[k]) if key == "start" else values[k]
            found.append(f"{key}={self._expression(f'{variable.elements[k]}, {key}', value)}")
        if variable.fixed or variable.elements[k] in self.whens.held:
            found.append("fixed=true")
        if variable.prefer in SELECT:
            found.append(f"stateSelect=StateSelect.{SELECT[variable.prefer]}")
        return f"({', '.join(found)})" if found else ""

    def _expression(self, place: str, value: ca.SX) -> str:
        """An expression of parameters, written out in full."""
        with located(place):
            (node,) = self.graph.read([value])
            return write([node], self.syntax, {})[node].text
