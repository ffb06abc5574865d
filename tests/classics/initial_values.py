"""Initial value and differential-algebraic problems: the ends of the run against those that the test set prints."""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gantrytau import Model, simulate, translate
from tests.classics import chemistry, circuits, constrained, printed_ends, wheelset
from tests.classics.lines import lines_of
from tests.classics.peers import ends_by_peers
from tests.classics.row import Row

TOLERANCE = 1e-10
WANTED = 8.0  # digits


@dataclass(frozen=True)
class InitialValueProblem:
    """A model, the end of its run in s, and the values of its variables there; equations: how many, and which index."""

    model: type[Model]
    equations: str
    stop: float
    ends: Mapping[str, Any]
    note: str = ""

    @property
    def name(self) -> str:
        """That of its model."""
        return self.model.__name__


def _vectors(values: list[float], names: list[str]) -> dict[str, list[float]]:
    parts = np.array(values).reshape(len(names), -1)
    return dict(zip(names, parts.tolist(), strict=True))


SQUEEZER_ENDS = {
    f"{joint}.{letter}": end
    for joint, both in printed_ends.SQUEEZER.items()
    for letter, end in zip(("phi", "w"), both, strict=True)
}
FEKETE_ENDS = _vectors(printed_ends.FEKETE, [f"points[{k}].r" for k in range(20)])
ROBERTSON_ENDS = {"a": 0.2083340149701255e-7, "b": 0.8333360770334713e-13, "c": 0.9999999791665050}
OREGONATOR_ENDS = {"a": 1.000814870318523, "b": 1228.178521549917, "c": 132.0554942846706}
SMALL = "a and b end at 2e-8 and 8e-14 of c: their own digits are fewer"
OWN = "the printed values hold to 7.6 digits; reference: its energy, by quadrature in 32 digits"
COARSE = "the printed values hold to 6.9 digits: DASSL with 1e-9; creep depends on the unknown loads: no rates for Radau"
MANY = "errors of 1.8 million steps add up: 2e-7 with a tolerance of 1e-9, 2e-8 with 1e-10"
PROBLEMS = (
    InitialValueProblem(chemistry.Hires, "8", 321.8122, {"y": printed_ends.HIRES}),
    InitialValueProblem(chemistry.Robertson, "3", 1e11, ROBERTSON_ENDS, SMALL),
    InitialValueProblem(chemistry.Oregonator, "3", 360.0, OREGONATOR_ENDS),
    InitialValueProblem(
        chemistry.StiffVanDerPol, "2", 2000.0, {"x": 1.706167732170469, "v": -0.8928097010248125e-3}
    ),
    InitialValueProblem(chemistry.Pollution, "20", 60.0, {"y": printed_ends.POLLUTION}),
    InitialValueProblem(
        circuits.RingModulator, "15", 1e-3, {"u": printed_ends.RING[:7], "i": printed_ends.RING[7:]}, MANY
    ),
    InitialValueProblem(circuits.Amplifier, "8, index 1", 0.2, {"y": printed_ends.VOLTAGES}),
    InitialValueProblem(constrained.CarAxis, "10, index 3", 3.0, printed_ends.AXIS),
    InitialValueProblem(wheelset.Wheelset, "17, index 2", 10.0, printed_ends.WHEELSET, COARSE),
    InitialValueProblem(constrained.Squeezer, "components, index 3", 0.03, SQUEEZER_ENDS, OWN),
    InitialValueProblem(constrained.Fekete, "160, index 3", 1000.0, FEKETE_ENDS),
)


def run(problem: InitialValueProblem) -> Row:
    """The problem by the toolkit and by peers."""
    exact = {
        f"{name}[{k}]" if np.ndim(end) else name: value
        for name, end in problem.ends.items()
        for k, value in enumerate(np.ravel(end))
    }
    begin = time.process_time()
    translated = translate(problem.model())
    made = time.process_time()
    result = simulate(translated, stop=problem.stop, tolerance=TOLERANCE, points=2)
    digits = _digits({name: float(result.final(name)) for name in exact}, exact)
    row: Row = {
        "equations": problem.equations,
        "lines": lines_of(problem.model),
        **digits,
        "steps": result.statistics.steps,
        "translate": round(made - begin, 3),
        "simulate": round(time.process_time() - made, 3),
    }
    for peer, answer in ends_by_peers(problem.model(), problem.stop, TOLERANCE).items():
        if isinstance(answer, str):
            row[peer] = answer
        else:
            known = {name: value for name, value in exact.items() if name in answer[0]}
            row[peer] = f"{_digits(answer[0], known)['mescd']:.1f} in {answer[1]:.2g} s"
    return {**row, "note": problem.note, "held": digits["mescd"] >= WANTED}


def _digits(found: Mapping[str, float], exact: Mapping[str, float]) -> dict[str, float]:
    """Digits of the worst variable: of its own size, and of 1 + its size, as the test set counts them (scd, mescd)."""
    error = np.array([abs(found[name] - value) for name, value in exact.items()])
    size = np.abs(np.array(list(exact.values())))
    with np.errstate(divide="ignore"):
        worst = {"scd": np.max(error / size), "mescd": np.max(error / (1 + size))}
        return {name: round(float(min(-np.log10(one), 16.0)), 2) for name, one in worst.items()}
