"""What stands in the body of a model class: quantities with unit and description, and arrays of components.

A declaration is inert. When a model is instantiated each one is replaced, on the instance, by a CasADi
symbol of the same shape; until then arithmetic on declarations is remembered as a formula, so that a
parameter can be bound to others (`area = Parameter(width * height)`, `Cart(m=Base.m_total)`).
"""

import enum
import operator
from collections.abc import Callable, Iterator
from itertools import product
from typing import Any, Generic, TypeVar

import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.border.units import shape_of
from gantrytau.describing.short_values import short

Component = TypeVar("Component")


class StateSelect(enum.IntEnum):
    """How gladly a variable becomes a state (Modelica Language Specification 3.6, section 4.9.7.1)."""

    NEVER = 0
    AVOID = 1
    DEFAULT = 2
    PREFER = 3
    ALWAYS = 4


def _arithmetic(operation: Callable[..., Any]) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """An operator between formulas, and its reflection."""
    return lambda a, b: Formula(operation, a, b), lambda a, b: Formula(operation, b, a)


def _no_relation(sign: str) -> Callable[..., Any]:
    def refuse(a: Any, b: Any) -> Any:
        raise ModelError(f"'{sign}' between declarations in a class body: equations stand in equations(self)")

    return refuse


class Formula:
    """An expression of declarations, evaluated when the model that contains it is instantiated."""

    def __init__(self, function: Callable[..., Any], *arguments: Any):
        self._function = function
        self._arguments = arguments

    def evaluate(self, scope: Any) -> Any:
        """The value of the formula where `scope` is the instance whose class body holds it."""
        return self._function(*(evaluate(argument, scope) for argument in self._arguments))

    def parts(self) -> tuple[str, tuple[Any, ...]]:
        """The name of its function, and to what it is applied."""
        return getattr(self._function, "__name__", "a function"), self._arguments

    def __repr__(self) -> str:
        names = [getattr(one, "name", "") or repr(one) for one in self._arguments]
        if self._function is operator.getitem:
            return f"{names[0]}[{names[1]}]"
        return f"{getattr(self._function, '__name__', 'a function')}({', '.join(names)})"

    __add__, __radd__ = _arithmetic(operator.add)
    __sub__, __rsub__ = _arithmetic(operator.sub)
    __mul__, __rmul__ = _arithmetic(operator.mul)
    __truediv__, __rtruediv__ = _arithmetic(operator.truediv)
    __pow__, __rpow__ = _arithmetic(operator.pow)
    __matmul__, __rmatmul__ = _arithmetic(operator.matmul)
    __le__, __ge__, __lt__, __gt__ = map(_no_relation, ("<=", ">=", "<", ">"))

    def __neg__(self) -> Any:
        return Formula(operator.neg, self)

    def __getitem__(self, index: Any) -> Any:
        return Formula(operator.getitem, self, index)

    def __iter__(self) -> Iterator[Any]:
        raise ModelError(f"{type(self).__name__}: a declaration has elements only inside equations(self)")

    def __getattr__(self, name: str) -> Any:
        # only the symbol that stands here after instantiation has .T, .shape and the like
        if name.startswith("__") or name not in {"T", "shape"}:
            raise AttributeError(f"{type(self).__name__} has no attribute '{name}'")
        return Formula(operator.attrgetter(name), self)

    def __eq__(self, other: Any) -> Any:
        return True if self is other else _no_relation("==")(self, other)

    __hash__ = object.__hash__


def evaluate(value: Any, scope: Any) -> Any:
    """A formula evaluated in the instance `scope`; a function called with it; all else as it is."""
    if isinstance(value, Formula):
        return value.evaluate(scope)
    if isinstance(value, (list, tuple)) and any(isinstance(item, Formula) for item in value):
        return [evaluate(item, scope) for item in value]
    if callable(value) and not isinstance(value, type):
        return value(scope)
    return value


class Quantity(Formula):
    """Base of Real, Parameter, Input, Output, Discrete, Flow and Propagated."""

    kind = "real"

    def __init__(
        self,
        shape: Any = (),
        *,
        unit: str | None = None,
        display: str | None = None,
        description: str = "",
        start: Any = None,
        fixed: bool = False,
        min: Any = None,
        max: Any = None,
        nominal: Any = None,
        prefer: StateSelect = StateSelect.DEFAULT,
        undetermined: str = "",
    ):
        self.declared_shape = shape
        self.unit = unit
        self.display = display
        self.description = description
        self.start = start
        self.fixed = fixed
        self.min = min
        self.max = max
        self.nominal = nominal
        self.prefer = prefer
        self.undetermined = undetermined
        self.name = ""
        self.owner = ""

    def parts(self) -> tuple[str, tuple[Any, ...]]:
        """Its name, applied to nothing."""
        return self.name, ()

    def __repr__(self) -> str:
        """As it is declared, without what is left open: `Real(3, unit='m', description='position')`."""
        shape = self.declared_shape
        first = [short(shape)] if shape != () and not callable(shape) else []
        return self._declared(
            first, ("unit", "start", "fixed", "min", "max", "nominal", "description", "display")
        )

    def _declared(self, first: list[str], names: tuple[str, ...]) -> str:
        told = {name: getattr(self, name, None) for name in names}
        wanted = {
            k: v for k, v in told.items() if not (v is None or v is False or (isinstance(v, str) and not v))
        }
        spelled = [f"{name}={short(value)}" for name, value in wanted.items()]
        return f"{type(self).__name__}({', '.join([*first, *spelled])})"

    def __set_name__(self, owner: type, name: str) -> None:
        self.name, self.owner = name, owner.__name__

    def evaluate(self, scope: Any) -> Any:
        try:
            found = getattr(scope, self.name)
        except AttributeError:
            found = self
        if found is self or isinstance(found, Quantity):
            raise ModelError(
                f"{type(scope).__name__}: the expression refers to '{self.owner}.{self.name}', which is not a member of "
                f"{type(scope).__name__}; refer to a parameter of the class that holds the expression"
            )
        return found

    def words(self) -> str:
        """Description and unit, for messages."""
        return ", ".join(part for part in (self.description, self.unit or "") if part)


class Real(Quantity):
    """A real variable: `Real(unit="m")`, `Real(3, unit="m/s")`, `Real((3, 3))`.

    shape: (), an int or a tuple; a function of the instance where it depends on its settings.
    start: guess of the initial value (None: no opinion); fixed: the start is an initial condition.
    unit: coherent SI, in which all its numbers are; display: the unit in which figures and printing show it, as "deg".
    min, max: limits used by optimisation; nominal: typical magnitude; prefer: see StateSelect.
    undetermined: the likely cause where the equations do not determine it, for messages.
    """

    inlined = False  # whether it is an expression where an equation has it alone on a side


class Input(Quantity):
    """A variable that is known from outside; the optimiser chooses it, `simulate` is given it."""

    kind = "input"


class Output(Quantity):
    """A variable that the model offers to the outside."""

    kind = "output"


class Discrete(Quantity):
    """A variable that only actions of `when` set, and that holds its value in between: `Discrete(0)`, `Discrete([0, 0])`.

    start: its value until then, a number, an array of its shape, or an expression of parameters (then `shape`, if it is
    no scalar); True and False are 1 and 0. It has no derivative, and counts as known in the equations.
    """

    kind = "discrete"

    def __init__(
        self,
        start: Any = 0.0,
        *,
        shape: Any = None,
        unit: str | None = None,
        display: str | None = None,
        description: str = "",
        min: Any = None,
        max: Any = None,
        nominal: Any = None,
    ):
        if shape is None:
            shape = () if callable(start) or isinstance(start, Formula) else np.shape(start)
        limits = dict(min=min, max=max, nominal=nominal)
        super().__init__(shape, unit=unit, display=display, description=description, start=start, **limits)

    def __repr__(self) -> str:
        return self._declared(
            [short(self.start)], ("unit", "min", "max", "nominal", "description", "display")
        )


class Flow(Quantity):
    """A connector variable whose sum over a connection is zero: force, torque, current."""

    kind = "flow"


class Propagated(Quantity):
    """A connector quantity that is not a variable: it is passed on along a spanning tree of the frames.

    Orientation is one: R of a frame is an expression of the joint angles between it and the root.
    rate: its time derivative as a function of the connector, where that is shorter than the chain rule.
    """

    kind = "propagated"

    def __init__(self, shape: Any = (), *, rate: Callable[[Any], Any] | None = None, **attributes: Any):
        super().__init__(shape, **attributes)
        self.rate = rate


class Parameter(Quantity):
    """A constant of one simulation: a number or array, or an expression of other parameters.

    value: number, array, text with a unit ("700 mm"), formula of declarations (`2 * m`), or function of the instance
    (`lambda self: self.L / 2`). Its shape is that of the value, unless `shape` says otherwise.
    evaluate: the value shapes the equations (a joint axis): it is folded in when the model is
    translated, as Modelica's annotation Evaluate=true. assumed: what `check` says where nobody gives another value.
    """

    kind = "parameter"
    free = False  # whether an optimiser chooses it
    final = False  # in Modelica text: no other value may be given

    def __init__(
        self,
        value: Any = None,
        *,
        unit: str | None = None,
        display: str | None = None,
        description: str = "",
        min: Any = None,
        max: Any = None,
        nominal: Any = None,
        shape: Any = None,
        evaluate: bool = False,
        assumed: str = "",
    ):
        if shape is None:
            shape = () if value is None or callable(value) or isinstance(value, Formula) else shape_of(value)
        words: dict[str, Any] = dict(unit=unit, display=display, description=description)
        super().__init__(shape, **words, min=min, max=max, nominal=nominal)
        self.value = value
        self.fold = evaluate
        self.assumed = assumed

    def __repr__(self) -> str:
        first = [] if self.value is None else [short(self.value)]
        return self._declared(first, ("unit", "min", "max", "nominal", "description", "display"))


class Array(Generic[Component]):
    """Several components of a class: `Array(Cart, 3, m=2.0)`, `Array(Cart, [dict(m=1.0), dict(m=2.0)])`."""

    def __init__(self, component: Callable[..., Component], count: int | list[Any], **modifications: Any):
        if isinstance(count, int):
            count = [{} for _ in range(count)]
        self.component = component
        self.elements = [
            component(**{**modifications, **one}) if isinstance(one, dict) else one for one in count
        ]
        self.shape: tuple[int, ...] = (len(self.elements),)  # the elements stand row after row

    def names(self, name: str, first: int) -> list[str]:
        """Names of the elements; first: the lowest index."""
        places = product(*(range(first, first + size) for size in self.shape))
        return [f"{name}[{','.join(map(str, place))}]" for place in places]

    def __repr__(self) -> str:
        name = getattr(self.component, "__name__", "a function")
        return f"Array({name}, {len(self.elements)})"

    def __getitem__(self, index: int) -> Component:
        return self.elements[index]

    def __iter__(self) -> Iterator[Component]:
        return iter(self.elements)

    def __len__(self) -> int:
        return len(self.elements)


class Start:
    """Modification: the guess of an initial value, `x=Start(0.5)`."""

    fixed = False

    def __init__(self, value: Any):
        self.value = value

    def __repr__(self) -> str:
        return f"{type(self).__name__}({short(self.value)})"

    def attributes(self) -> dict[str, Any]:
        """The attributes of the variable that this modification sets."""
        return dict(start=self.value, fixed=self.fixed) if self.value is not None else dict(fixed=self.fixed)


class Fixed(Start):
    """Modification: an initial condition, `x=Fixed(0.5)`."""

    fixed = True


class Bounds:
    """Modification: the limits of a variable, `x=Bounds(-1, 1)`."""

    def __init__(self, min: Any = None, max: Any = None):
        self.min = min
        self.max = max

    def __repr__(self) -> str:
        return f"Bounds({short(self.min)}, {short(self.max)})"

    def attributes(self) -> dict[str, Any]:
        """The attributes of the variable that this modification sets."""
        return {key: limit for key, limit in (("min", self.min), ("max", self.max)) if limit is not None}


def is_setting(value: Any, name: str) -> bool:
    """Whether a class attribute is a plain constant that shapes the model, such as `order = 2`."""
    return not name.startswith("_") and isinstance(value, (bool, int, float, str))
