"""A sampled controller as plain C for a microcontroller: `controller.h` and `controller.c`, fixed step, no heap."""

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import casadi as ca

from gantrytau import Model, translate
from gantrytau.answers.instant_function import sample_function
from gantrytau.answers.sampled_code import SampledCode
from gantrytau.border.checks import check_words, instance
from gantrytau.border.refusal import Given, ModelError
from gantrytau.language.instructions import computed
from gantrytau_fmu.code.expressions import NAMES
from gantrytau_fmu.code.operations import OPERATIONS, number_text

LINE_HEADER = Path(__file__).with_name("board_line.h")
# without numbers of double precision, and without the library of C, which a target without operating system may lack
OWN = {
    "TWICE": "2 * {0}",
    "INV": "1 / {0}",
    "IF_ELSE_ZERO": "{0} != 0 ? {1} : 0",
    "FMIN": "{0} < {1} ? {0} : {1}",
    "FMAX": "{0} > {1} ? {0} : {1}",
    "FABS": "{0} <= 0 ? 0 - {0} : {0}",
    "SIGN": "({0} > 0) - ({0} < 0)",
    "TANH": "tanh({0})",
}
HEADER = """/* {name}: sampled controller, one step every {period} s. From gantrytau. */
#ifndef CONTROLLER_H
#define CONTROLLER_H
typedef {real} controller_real;
#define CONTROLLER_PERIOD {period} /* s */
#define CONTROLLER_GIVEN {given} /* {given_names} */
#define CONTROLLER_FOUND {found} /* {found_names} */
typedef struct {{
    controller_real held[{held}]; /* {held_names} */
}} controller_state;
void controller_init(controller_state *state);
void controller_step(controller_state *state, const controller_real *given, controller_real *found);
#endif
"""


@dataclass(frozen=True, kw_only=True)
class StepCode(SampledCode):
    """C of a sampled model, and the same step as a function of CasADi.

    function: (given, held) -> (find, held behind); start: of what is held.
    """

    function: ca.Function
    start: tuple[float, ...]

    def write(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write `controller.h`, `controller.c` and `board_line.h`, the serial protocol, into a folder; their paths."""
        return [*super().write(folder), write_line(folder)]


def write_line(folder: str | os.PathLike[str]) -> Path:
    """Write `board_line.h`, the serial protocol of a board, into a folder; its path."""
    target = Path(folder) / LINE_HEADER.name
    target.write_text(LINE_HEADER.read_text(encoding="utf-8"), encoding="utf-8", newline="\n")
    return target


def step_code(
    model: Model, *, given: Sequence[str], find: Sequence[str], real: Literal["double", "float"] = "double"
) -> StepCode:
    """C99 of a sampled controller: `controller_init` and `controller_step`, straight code without loops and heap.

    given: measured values and references, find: what the controller sets, by name; real: the type of all numbers.
    Parameters have the model's values. Raises ModelError for a model with states or several periods, and for equations
    that are solved by iteration.
    """
    check_words(step_code, {"real": real})
    instance("step_code", "model", model, Model)
    for argument, names in {"given": given, "find": find}.items():
        if not names:
            raise ModelError("expected at least one name", place="step_code", found=Given(argument, names))
    dae = translate(model, given=given, find=find, events=True)
    step = sample_function(dae, given, find)
    periods = {dae.number(s.period) for s in dae.flat.sampled}
    if len(periods) != 1:
        words = "expected one; make a model for each, or count the samples of the fast one in the slow one"
        raise ModelError(words, place=dae.name, found=Given("periods", sorted(periods)))
    u = ca.SX.sym("u", sum(len(dae.expand(n)) for n in given))
    x = ca.SX.sym("x", len(dae.flat.sampled))
    try:
        scalar = step.expand()
    except RuntimeError as error:
        raise ModelError(
            f"{dae.name}: found equations that are solved by iteration, expected closed forms; solve them for their unknown"
        ) from error
    sizes = [0]
    for name in given:
        sizes.append(sizes[-1] + len(dae.expand(name)))
    found = [ca.densify(e) for e in scalar.call([*ca.vertsplit(u, sizes), x])]
    function = ca.Function("step", [u, x], found, ["given", "held"], ["find", "after"], {"cse": True})
    names = [[n for name in part for n in dae.expand(name)] for part in (given, find)]
    start = tuple(float(dae.start.get(s.name, 0.0)) for s in dae.flat.sampled)
    held = [s.name for s in dae.flat.sampled]
    header = HEADER.format(
        name=dae.name, real=real, period=number_text(periods.pop()), given=len(names[0]), found=len(names[1]),
        held=len(held), given_names=", ".join(names[0]), found_names=", ".join(names[1]), held_names=", ".join(held),
    )  # fmt: skip
    period = dae.number(dae.flat.sampled[0].period)
    source = _source(function, start)
    return StepCode(
        name=dae.name,
        given=tuple(names[0]), find=tuple(names[1]), function=function, start=start, period=period, real=real,
        header=header, source=source,
    )  # fmt: skip


def _source(function: ca.Function, start: Sequence[float]) -> str:
    """The text of `controller.c`: one local constant for each operation."""
    lines: list[str] = []
    used: set[str] = set()

    def operation(operator: int, inside: list[str]) -> str:
        name = NAMES[operator]
        if name in ("ASSIGN", "LIFT"):
            return inside[0]
        if name not in OPERATIONS:
            raise ModelError(f"step_code: found the operation {name}, expected those of gantrytau; reword it")
        text = OWN.get(name, OPERATIONS[name]).format(*inside)
        used.add(name)
        lines.append(f"    const controller_real w{len(lines)} = {text};")
        return f"w{len(lines) - 1}"

    found, held = computed(
        function,
        lambda k, i: f"given[{i}]" if k == 0 else f"held[{i}]",
        lambda value: f"(controller_real){number_text(value)}",
        operation,
    )
    stores = [f"    found[{k}] = {word};" for k, word in enumerate(found)]
    # held values are read until all are computed
    stores += [f"    const controller_real new_{k} = {word};" for k, word in enumerate(held)]
    stores += [f"    state->held[{k}] = new_{k};" for k in range(len(held))]
    starts = [f"    state->held[{k}] = (controller_real){number_text(v)};" for k, v in enumerate(start)]
    calls = any(re.match(r"\w+\(", OWN.get(n, OPERATIONS[n])) for n in used)
    text = [
        '#include "controller.h"',
        *(["#include <tgmath.h>"] if calls else []),
        "",
        "void controller_init(controller_state *state)",
        "{",
        *starts,
        "}",
        "",
        "void controller_step(controller_state *state, const controller_real *given, controller_real *found)",
        "{",
        "    const controller_real *held = state->held;",
        *lines,
        *stores,
        "}",
        "",
    ]
    return "\n".join(text)
