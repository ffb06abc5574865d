"""A plan as a robot program in RAPID (ABB): joint targets, moves in joint coordinates, a trigger for the device.

At each pose to be measured it waits for who measures (TPReadFK), or for a time after a word or a pulse.

Lengths in mm and angles in degrees. Numbers of RAPID are single precision: 0.1 um of a metre. Lines have 80 ASCII
characters at most, names 32.
"""

import re
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import check_words, number
from gantrytau.border.refusal import Given
from gantrytau.describing.record import Record
from gantrytau_optimica.fitting.finding import length_text
from gantrytau_optimica.procedure.pose_choice import CRITERION
from gantrytau_optimica.procedure.pose_plan import PosePlan

WIDTH = 80
AXES = 6  # of robax and of extax
OPERATOR, WORDS = "operator", "TPWrite"  # triggers that are no digital outputs
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,31}")
RESERVED = {
    "module", "endmodule", "proc", "endproc", "const", "pers", "var", "local", "task", "func", "endfunc", "trap",
    "endtrap", "if", "then", "else", "endif", "for", "from", "to", "step", "do", "endfor", "while", "endwhile", "test",
    "case", "default", "return", "true", "false", "not", "and", "or", "xor", "div", "mod", "with", "goto", "raise",
    "retry", "error", "undo", "exit",
}  # fmt: skip


@dataclass(frozen=True)
class RapidOptions(Record):
    """Options of a robot program, as `CalibrationPlan.program` explains them; ModelError for what RAPID does not take."""

    name: str = "Calibration"
    speed: float = 0.1
    settle: float = 1.0
    measure: float = 2.0
    carts: Literal["robax", "extax"] = "robax"
    trigger: str = OPERATOR
    tool: str = "tool0"

    def __post_init__(self):
        check_words(RapidOptions, vars(self), "program")
        number("program", "speed", self.speed, least=1e-3)
        number("program", "settle", self.settle, least=0.0)
        number("program", "measure", self.measure, least=0.0)
        for what in ("name", "tool", *(() if self.trigger in (OPERATOR, WORDS) else ("trigger",))):
            word = getattr(self, what)
            if not NAME.fullmatch(word) or word.lower() in RESERVED:
                raise ModelError(
                    "expected a name of RAPID: a letter, then letters, digits and _, 32 characters at most, no reserved "
                    "word",
                    place="program",
                    found=Given(what, word),
                )


def rapid_program(plan: PosePlan, options: RapidOptions) -> str:
    """The text of a RAPID module that drives through the poses of a plan."""
    name, carts, trigger = options.name, options.carts, options.trigger
    lines = [f"MODULE {name}", *_comments(plan, carts, trigger)]
    speed = _number(options.speed * 1e3, 3)
    lines += [f"  CONST speeddata speedCalibration:=[{speed},20,{speed},20];"]
    lines += ["  VAR num keyCalibration;"] if trigger == OPERATOR else []
    labels = [_label(plan, k) for k in range(len(plan.q))]
    for label in dict.fromkeys(labels):
        lines += _target(label, plan.q[labels.index(label)], plan.carts, carts)
    lines += ["", f"  PROC {_procedure(name)}()"]
    count, done = int(plan.measured.sum()), 0
    for label, measured in zip(labels, plan.measured, strict=True):
        lines.append(f"    MoveAbsJ {label}, speedCalibration, fine, {options.tool};")
        if measured:
            done += 1
            lines += _trigger(trigger, f"{label}, {done} of {count}", options.settle, options.measure)
    lines += ["  ENDPROC", "ENDMODULE", ""]
    return "\n".join(lines)


def _procedure(name: str) -> str:
    return f"Run{name}"[:32]


def _label(plan: PosePlan, row: int) -> str:
    """Name of the target of a row of the program, by its number in poses.csv of the whole plan."""
    number = int(plan.numbers[row])
    if number == 1 or row == len(plan.q) - 1:
        return "pHome"
    return f"p{number:03d}" if plan.measured[row] else f"via{number:03d}"


def _target(label: str, q: np.ndarray, count: int, carts: str) -> list[str]:
    values = [_number(x * 1e3, 4) for x in q[:count]] + [_number(np.degrees(x), 5) for x in q[count:]]
    unused = ["0"] * AXES if carts == "extax" else ["9E9"] * AXES
    moving = values + ["0" if carts == "robax" else "9E9"] * (AXES - len(values))
    robax, extax = (moving, unused) if carts == "robax" else (unused, moving)
    return [f"  CONST jointtarget {label}:=", f"    [[{','.join(robax)}],", f"     [{','.join(extax)}]];"]


def _number(value: float, decimals: int) -> str:
    text = f"{value:.{decimals}f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def _trigger(trigger: str, words: str, settle: float, measure: float) -> list[str]:
    rest = f"    WaitTime \\InPos, {_number(settle, 3)};"
    if trigger == OPERATOR:
        return [
            rest,
            f'    TPReadFK keyCalibration, "Measure {words}", stEmpty, stEmpty,',
            '      stEmpty, stEmpty, "Done";',
        ]
    pulse = [] if trigger == WORDS else [f"    PulseDO \\PLength:=0.2, {trigger};"]
    return [
        rest,
        f'    TPWrite "Measure {words}";',
        *pulse,
        f"    WaitTime {_number(measure, 3)};",
    ]


def _comments(plan: PosePlan, carts: str, trigger: str) -> list[str]:
    unused = "unused robax 0, extax 9E9" if carts == "robax" else "carts are external axes, unused extax 9E9"
    said = [
        f"Calibration of {plan.robot_name}: {int(plan.measured.sum())} poses to measure, "
        f"{int((~plan.measured).sum())} only passed (home at begin and end).",
        f"Joint targets: carts in mm, turntables in degrees; {unused}. Moves are linear in these axes and were checked "
        "on all of their way; do not change order, targets or kind of move. p041 is row 41 of poses.csv of the whole plan.",
        "The first move goes home from wherever the robot stands; that way was not checked: jog the robot to pHome by hand "
        "before the start, and after each stop begin there again.",
        _waiting(trigger),
        f"Expected error of the tool by noise after calibration with all {len(plan.prediction.rows)} poses of the plan "
        f"{length_text(plan.prediction.error)}; of the worst simulated robot {length_text(plan.verdict.error)}, wanted "
        f"{length_text(plan.verdict.wanted)}: {'good' if plan.verdict.good else 'NOT GOOD ENOUGH'}.",
        f"Poses: {CRITERION}.",
        f"Nominal parameters in m ({plan.kind}):",
        *_parameters(plan),
    ]
    return [line for words in said for line in _wrapped(words)] + [""]


def _waiting(trigger: str) -> str:
    if trigger == OPERATOR:
        return "At each pose to measure it waits until Done is pressed on the pendant."
    pulse = "" if trigger == WORDS else f", pulses {trigger}"
    return f"At each pose to measure it says so on the pendant{pulse}, and goes on by itself after a time."


def _parameters(plan: PosePlan) -> Sequence[str]:
    return [
        f"{name} = " + ", ".join(_number(float(x), 7) for x in np.atleast_1d(value))
        for name, value in plan.parameters.items()
    ]


def _wrapped(words: str) -> list[str]:
    plain = words.encode("ascii", "replace").decode()
    return textwrap.wrap(plain, WIDTH, initial_indent="  ! ", subsequent_indent="  !   ")
