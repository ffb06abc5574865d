"""Expressions as one graph without repetitions.

CasADi's instruction lists of several functions are entered into the same graph. What depends on parameters
alone is found there, so that it is computed once when a parameter is set, not at every call; sums of products
with it are multiplied out where that saves operations.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import casadi as ca

from gantrytau.border.refusal import ModelError
from gantrytau.language.instructions import computed
from gantrytau_fmu.code.operations import OPERATIONS

NAMES = {getattr(ca, name): name[3:] for name in dir(ca) if name.startswith("OP_")}

COMMUTING = {"ADD", "MUL", "EQ", "NE", "AND", "OR", "FMIN", "FMAX"}
UNHOISTED = {"NEG", "TWICE"}  # cheaper again than a load

SIGNS = {"ADD": (1.0, 1.0), "SUB": (1.0, -1.0), "NEG": (-1.0,), "TWICE": (2.0,)}
WIDEST = 1  # nodes in a sum that is multiplied out: measured, more cost more operations than they save

Form = tuple[dict[int, int], int]  # a sum: factor by node, and what is added; both rarely change
Node = tuple  # ("INPUT", array, index), ("CONST", value) or (operation, node number, ...)


@dataclass(eq=False)
class ExpressionGraph:
    """Nodes by number; `slow`: names of the arrays that rarely change, whose expressions are hoisted."""

    arrays: Sequence[str]
    slow: str = "p"
    nodes: list[Node] = field(default_factory=list)
    rarely: list[bool] = field(default_factory=list)
    hoisted: dict[int, int] = field(default_factory=dict)
    forms: dict[int, Form] = field(default_factory=dict)
    _numbers: dict[Node, int] = field(default_factory=dict)

    def enter(self, name: str, arguments: Mapping[str, ca.SX], results: ca.SX) -> list[int]:
        """Numbers of the nodes of `results`, dense, in symbols of `arguments`, by array name."""
        function = ca.Function(name, list(arguments.values()), [ca.densify(results)], {"cse": True})
        arrays = list(arguments)
        (roots,) = computed(
            function,
            lambda k, i: self.node("INPUT", arrays[k], i),
            lambda value: self.node("CONST", value),
            lambda operator, inside: self.operation(NAMES[operator], inside),
        )
        return roots

    def operation(self, name: str, inside: list[int]) -> int:
        """The node of an operation, simplified where it is linear."""
        if name in ("ASSIGN", "LIFT"):
            return inside[0]
        if name not in OPERATIONS:
            raise ModelError(
                f"export_fmu: the model uses the operation {name}, expected those of gantrytau; reword it"
            )
        if name in ("DIV", "INV"):
            one = self.node("CONST", 1.0)
            return self._product(one if name == "INV" else inside[0], self._reciprocal(inside[-1]))
        if name == "MUL":
            return self._product(*inside)
        if name in SIGNS:
            factors = [self.node("CONST", sign) for sign in SIGNS[name]]
            return self._sum([(factor, i) for factor, i in zip(factors, inside, strict=True)])
        if name in COMMUTING:
            inside = sorted(inside)
        return self.node(name, *inside)

    def _reciprocal(self, number: int) -> int:
        key = self.nodes[number]
        return self.node("CONST", 1.0 / key[1]) if key[0] == "CONST" and key[1] else self.node("INV", number)

    def _product(self, a: int, b: int) -> int:
        if self.rarely[a] and self.rarely[b]:
            return self._folded("MUL", a, b)
        if self.rarely[a]:
            return self._sum([(a, b)])
        if self.rarely[b]:
            return self._sum([(b, a)])
        return self.node("MUL", *sorted((a, b)))

    def _folded(self, name: str, a: int, b: int) -> int:
        """The sum or product of two nodes that rarely change; numbers are computed."""
        first, second = self.nodes[a], self.nodes[b]
        if first[0] != "CONST":
            first, second, a, b = second, first, b, a
        if first[0] != "CONST":
            return self.node(name, *sorted((a, b)))
        if second[0] == "CONST":
            return self.node("CONST", first[1] + second[1] if name == "ADD" else first[1] * second[1])
        if name == "MUL" and first[1] == 0.0:
            return self.node("CONST", 0.0)
        return b if first[1] == (0.0 if name == "ADD" else 1.0) else self.node(name, *sorted((a, b)))

    def _sum(self, terms: Iterable[tuple[int, int]]) -> int:
        """Sum of factor * node, the factors rarely changing: written in few nodes with factors computed once."""
        terms = list(terms)
        found = self._combined(terms, self.forms)
        if len(found[0]) > WIDEST:
            found = self._combined(terms, {})
        return self._written(*found)

    def _combined(self, terms: Sequence[tuple[int, int]], forms: Mapping[int, Form]) -> Form:
        factors: dict[int, int] = {}
        constant = self.node("CONST", 0.0)
        for factor, number in terms:
            if self.rarely[number]:
                constant = self._folded("ADD", constant, self._folded("MUL", factor, number))
                continue
            inner, rest = forms.get(number, ({number: None}, None))
            if rest is not None:
                constant = self._folded("ADD", constant, self._folded("MUL", factor, rest))
            for base, weight in inner.items():
                part = factor if weight is None else self._folded("MUL", factor, weight)
                factors[base] = self._folded("ADD", factors[base], part) if base in factors else part
        return {b: f for b, f in factors.items() if self.nodes[f] != ("CONST", 0.0)}, constant

    def _written(self, factors: dict[int, int], constant: int) -> int:
        """The node of a sum; its form is kept, so that sums of it can be simplified."""
        found = None if self.nodes[constant] == ("CONST", 0.0) else constant
        for base, factor in sorted(factors.items(), key=lambda item: self.nodes[item[1]] == ("CONST", -1.0)):
            key = self.nodes[factor]
            if key == ("CONST", -1.0):
                found = self.node("NEG", base) if found is None else self.node("SUB", found, base)
                continue
            term = base if key == ("CONST", 1.0) else self.node("MUL", *sorted((base, factor)))
            found = term if found is None else self.node("ADD", *sorted((found, term)))
        if found is None:
            return self.node("CONST", 0.0)
        if not self.rarely[found]:
            self.forms[found] = (factors, constant)
        return found

    def node(self, *key) -> int:
        """The number of a node, made when it is first asked for."""
        found = self._numbers.get(key)
        if found is None:
            found = self._numbers[key] = len(self.nodes)
            self.nodes.append(key)
            if key[0] == "INPUT":
                self.rarely.append(key[1] == self.slow)
            else:
                self.rarely.append(key[0] == "CONST" or all(self.rarely[i] for i in key[1:]))
        return found

    def hoist(self, roots: Iterable[int]) -> None:
        """Give what rarely changes, and is used by the expressions of `roots`, places in the hoisted array."""
        roots = list(roots)
        used = [number for number in self.reached(roots, stop=self.rarely) if not self.rarely[number]]
        for number in sorted({*roots, *(i for n in used for i in self.inside(n))}):
            worth = self.nodes[number][0] not in ("INPUT", "CONST", *UNHOISTED)
            if self.rarely[number] and worth and not self._fixed(number):
                self.hoisted.setdefault(number, len(self.hoisted))

    def _fixed(self, number: int) -> bool:
        return not any(self.nodes[n][0] == "INPUT" for n in self.reached([number]))

    def divisors(self, roots: Iterable[int]) -> list[int]:
        """What is divided by on the way to the roots and changes often."""
        inverted = [self.nodes[n][1] for n in self.reached(roots) if self.nodes[n][0] == "INV"]
        return [n for n in dict.fromkeys(inverted) if not self.rarely[n]]

    def inside(self, number: int) -> tuple[int, ...]:
        """The nodes that an operation works on."""
        key = self.nodes[number]
        return () if key[0] in ("INPUT", "CONST") else key[1:]

    def reached(
        self, roots: Iterable[int], stop: Sequence[bool] | None = None, known: Iterable[int] = ()
    ) -> list[int]:
        """All nodes that the roots need, in an order of computation; nothing is looked for behind `known`."""
        seen, waiting, known = set(), list(roots), set(known)
        while waiting:
            number = waiting.pop()
            if number in seen:
                continue
            seen.add(number)
            if number not in known and not (stop is not None and stop[number]):
                waiting += [i for i in self.inside(number) if i not in seen]
        return sorted(seen)  # a node is made after those inside it
