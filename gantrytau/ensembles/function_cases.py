"""The cases of a function: its keyword arguments, checked before the first call."""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.ensembles.cases import SEED, Axes, Case


@dataclass(frozen=True, eq=False)
class FunctionTask:
    """Calls a function with what a case chooses."""

    function: Callable[..., Any]

    def __call__(self, case: Case) -> Any:
        """What the function returns."""
        return self.function(**case.names)

    @property
    def name(self) -> str:
        """Of the function."""
        inner = self.function.func if isinstance(self.function, partial) else self.function
        return getattr(inner, "__name__", type(inner).__name__)


def function_task(function: Any, axes: Axes, unused: Mapping[str, Any]) -> FunctionTask:
    """The task of a function; ModelError for what cannot be called, or not with these names.

    unused: keywords that only models have.
    """
    if isinstance(function, type) or not callable(function):
        raise ModelError(
            f"study: found {function!r}, expected a model, as Pendulum(), or a function of keyword arguments",
            argument="model",
        )
    task = FunctionTask(function)
    for name, value in unused.items():
        if value is not None:
            raise ModelError(
                f"study: found {name}={value!r} with the function {task.name}, expected it with a model only; give what "
                "the function needs by over=, or by functools.partial",
                argument=name,
            )
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):  # of compiled code
        return task
    named = [p.name for p in parameters if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)]
    given = [*axes.over, *((SEED,) if axes.seeds is not None else ())]
    if not any(p.kind is p.VAR_KEYWORD for p in parameters):
        for name in given:
            if name not in named:
                raise ModelError(
                    f"study: {task.name} has no argument '{name}'{did_you_mean(name, named)}",
                    argument="seeds" if name == SEED else "over",
                )
    missing = [p.name for p in parameters if p.name in named and p.default is p.empty and p.name not in given]
    if missing:
        raise ModelError(
            f"study: {task.name} needs {', '.join(missing)}, expected values by over=; or give a default",
            argument="over",
        )
    return task
