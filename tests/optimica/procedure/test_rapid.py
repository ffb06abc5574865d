"""The robot program, read back by a small parser of RAPID, against the plan."""

import re

import numpy as np
import pytest

from gantrytau_optimica import Measurements, load_plan, plan_calibration
from tests.optimica.procedure import cells
from tests.optimica.refusals import refused

DONE = 'TPReadFK keyCalibration,"Measure {}, {} of {}",stEmpty,stEmpty,stEmpty,stEmpty,"Done";'
TARGET = re.compile(r"CONST jointtarget (\w+):=\[\[([^\]]*)\],\[([^\]]*)\]\];")
MOVE = re.compile(r"MoveAbsJ (\w+),(\w+),fine,(\w+);")


@pytest.fixture(scope="module")
def plan():
    return plan_calibration(*cells.l1(), poses=10, robots=2, tape=0.003, spacing=0.2)


def read(text):
    """Targets by name, (6,) and (6,), and what the procedure does in its order: names moved to, statements between."""
    lines = [line.strip() for line in text.splitlines() if not line.strip().startswith("!")]
    program = re.sub(r"\s*\n\s*", "", "\n".join(lines).replace("ENDPROC", "ENDPROC;"))
    targets = {
        name: tuple(np.array([float(x) for x in part.split(",")]) for part in (robax, extax))
        for name, robax, extax in TARGET.findall(program)
    }
    body = text[text.index("PROC ") : text.index("ENDPROC")]
    return targets, [line.strip().replace(", ", ",") for line in body.splitlines()[1:] if line.strip()]


def moved(body):
    """The moves of a program, all of which can be read."""
    lines = [line for line in body if line.startswith("MoveAbsJ")]
    moves = [move for line in lines if (move := MOVE.fullmatch(line))]
    assert len(moves) == len(lines)
    return moves


@pytest.mark.parametrize("carts", ["robax", "extax"])
def test_the_program_goes_to_the_poses_of_the_plan(plan, carts):
    targets, body = read(plan.program(carts=carts, tool="tReflector"))
    moves = moved(body)
    assert {move[3] for move in moves} == {"tReflector"}
    used, unused = (0, 1) if carts == "robax" else (1, 0)
    commanded = np.array([targets[move[1]][used][:3] for move in moves]) / 1e3
    # 4 decimals of a millimetre
    np.testing.assert_allclose(commanded, plan.q, rtol=0, atol=0.51e-7)
    for robax, extax in targets.values():
        rest = (robax, extax)[unused]
        assert (rest == (9e9 if carts == "robax" else 0)).all()
        assert ((robax, extax)[used][3:] == (0 if carts == "robax" else 9e9)).all()
    assert moves[0][1] == moves[-1][1] == "pHome"


def test_it_settles_and_triggers_at_measured_poses_only(plan):
    _, body = read(plan.program(trigger="doMeasure", settle=0.5, measure=1.25))
    starts = [k for k, line in enumerate(body) if line.startswith("MoveAbsJ")]
    parts = [body[a + 1 : b] for a, b in zip(starts, [*starts[1:], len(body)], strict=True)]
    assert [bool(part) for part in parts] == plan.measured.tolist()
    for part in (part for part in parts if part):
        assert part[0] == r"WaitTime \InPos,0.5;"
        assert part[1].startswith('TPWrite "Measure p')
        assert part[2:] == [r"PulseDO \PLength:=0.2,doMeasure;", "WaitTime 1.25;"]
    assert "PulseDO" not in plan.program(trigger="TPWrite")


def test_without_a_trigger_it_waits_for_who_measures(plan):
    text = plan.program()
    _, body = read(text)
    joined = "\n".join(body).replace(",\n", ",").splitlines()
    asked = [line.replace('", stEmpty', '",stEmpty') for line in joined if line.startswith("TPReadFK")]
    numbers = np.flatnonzero(plan.measured) + 1
    assert asked == [
        DONE.format(f"p{number:03d}", k, len(numbers)).replace(", ", ",").replace("Measure ", "Measure ")
        for k, number in enumerate(numbers, 1)
    ]
    assert "VAR num keyCalibration;" in text
    assert not any(line.startswith(("TPWrite", "PulseDO")) for line in body)
    # one rest before each question and no other: the key says when to go on
    assert sum(line.startswith("WaitTime") for line in body) == len(numbers)
    assert "VAR num" not in plan.program(trigger="TPWrite")


def test_the_program_of_the_rest_keeps_the_numbers_of_the_plan(plan, tmp_path):
    numbers = np.flatnonzero(plan.measured) + 1
    left = numbers[[1, 4, 7]]
    done = ~np.isin(np.arange(1, len(plan.q) + 1), left) & plan.measured
    rest = plan.remaining(Measurements(plan.q[done], plan.r[done]))
    targets, body = read(rest.program(name="Rest"))
    asked = {int(line[line.index("Measure p") + 9 :][:3]) for line in body if "Measure p" in line}
    assert asked == set(left.tolist())
    for number in left:
        np.testing.assert_allclose(
            targets[f"p{number:03d}"][0][:3], plan.q[number - 1] * 1e3, atol=0.51e-4, rtol=0
        )
    moves = [move[1] for move in moved(body)]
    assert set(moves) == set(targets)
    for name in set(moves) - {"pHome"}:
        np.testing.assert_allclose(
            targets[name][0][:3], plan.q[int(re.sub(r"\D", "", name)) - 1] * 1e3, atol=0.51e-4, rtol=0
        )
    rest.write(tmp_path, name="Rest")
    lines = (tmp_path / "measurements-template.csv").read_text().splitlines()
    assert lines[0] == "number,q1,q2,q3,x,y,z"
    assert sorted(int(line.split(",")[0]) for line in lines[1:]) == left.tolist()
    assert all(line.endswith(",,,") for line in lines[1:])
    assert load_plan(tmp_path).numbers.tolist() == rest.numbers.tolist()


def test_lines_and_names_are_those_that_rapid_takes(plan):
    text = plan.program(name="A" * 32, carts="extax", trigger="do_0123456789012345678901234567")
    assert text.isascii()
    assert max(map(len, text.splitlines())) <= 80
    code = re.sub(r'"[^"]*"|!.*', "", text)
    assert max(map(len, re.findall(r"[A-Za-z_]\w*", code))) <= 32
    names = re.findall(r"(?:jointtarget|speeddata|PROC|MODULE) (\w+)", code)
    assert len(set(map(str.lower, names))) == len(names)
    comments = " ".join(line.strip(" !") for line in text.splitlines() if line.strip().startswith("!"))
    for words in (
        "GantryTau",
        "mm",
        "degrees",
        "Nahvi",
        "D-optimal",
        "arms[0].length = 2.0608",
        "that way was not checked",
    ):
        assert words in comments


@pytest.mark.parametrize(
    "wrong",
    [
        dict(name="1st"),
        dict(name="B" * 33),
        dict(name="Module"),
        dict(trigger="do measure"),
        dict(tool=""),
        dict(carts="axes"),
        dict(speed=0.0),
        dict(settle=-1.0),
        dict(measure=float("nan")),
    ],
)
def test_what_rapid_does_not_take_is_refused(plan, wrong):
    with refused(*wrong):
        plan.program(**wrong)
