"""A predictive controller as C: `controller.h` and `controller.c` of its numbers, its stage function and a template."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from gantrytau import ModelError
from gantrytau.answers.c_code import c_source
from gantrytau.answers.sampled_code import SampledCode
from gantrytau_optimica.predictive.horizon_qp import RIDGE
from gantrytau_optimica.predictive.plan import APART, PlannedMotion
from gantrytau_optimica.predictive.stages import HorizonStages
from gantrytau_optimica.predictive.terminal import SteadyState, Terminal

TEMPLATES = Path(__file__).parent
TURNS = 60  # of the interior-point method, at most; 10 to 25 are usual
CLOSE, GOOD = 1e-14, 1e-9  # of products of slacks and multipliers: where it ends, and what is a solution
KEPT = 1e-11  # of limits, in sizes
YIELD = 1e-10  # of limits by their multipliers: among 1e-9 to 1e-13 what ill-conditioned programs bear best


def controller_code(
    mpc: Any,
    soft: np.ndarray,
    penalty: float,
    first: PlannedMotion,
    limits: tuple[int, int, float],
    estimates: Mapping[str, float],
) -> SampledCode:
    """C of an Mpc. soft (rows,): which slack a limit has, -1 for none; first: plan, NaN for measured states; limits: most
    iterations of the first plan and of a step, and changes by which they are done; estimates: by name until one is given.

    ModelError for courses, which are functions of Python, and for a steady state that moves.
    """
    stages: HorizonStages = mpc.stages
    known = [course.name for course in stages.phase.courses]
    if set(known) - set(estimates):
        names = ", ".join(name for name in known if name not in estimates)
        raise ModelError(
            f"{names}: a course is a function of Python, expected formulas of time for C; write it into the model",
            place=mpc.name,
        )
    rows = _rows(mpc, soft)
    sizes = dict(
        PERIOD=mpc.period, N=mpc.elements, NX=stages.nx, NZ=stages.nz, NU=stages.nu, NC=stages.costly.size, NK=len(known),
        NL=len(stages.path), NI=len(rows), MOVES=int(mpc.moves.wanted), SLACK=int(soft.max(initial=-1)) + 1,
        END=int(mpc.terminal.there), DELAY=mpc.delay, PENALTY=float(penalty), RIDGE=RIDGE,
        TURNS=TURNS, APART=APART, CLOSE=CLOSE, GOOD=GOOD, KEPT=KEPT, YIELD=YIELD,
        FIRST=limits[0], ITERATIONS=limits[1], STANDS=limits[2],
    )  # fmt: skip
    point = stage_point(stages, mpc.terminal)
    sizes["WORK"] = int(point.sz_w())
    told = {
        "@NAME@": mpc.name,
        "@PERIOD@": repr(mpc.period),
        "@PERIODS@": f"{mpc.elements} periods",
        "@FIRST@": str(limits[0]),
        "@ITERATIONS@": "one" if limits[1] == 1 else f"up to {limits[1]}",
        "@GIVEN@": str(stages.nx + len(known)),
        "@FOUND@": str(stages.nu),
        "@GIVEN_NAMES@": ", ".join((*mpc.states, *known)),
        "@FOUND_NAMES@": ", ".join(mpc.inputs),
        "@SIZES@": "\n".join(f"#define MPC_{name} {value!r}" for name, value in sizes.items()),
        "@POINT@": c_source(point, name="mpc_point").rstrip("\n"),
        "@TABLES@": "\n".join(
            [*_tables(mpc, rows, first), _numbers("mpc_known", [estimates[n] for n in known])]
        ),
    }
    header, source = (_filled(name, told) for name in ("controller.h", "controller.c"))
    flat = mpc.built.read.dae.flat
    own = {*mpc.states, *mpc.inputs}
    units = {n: v.unit for v in flat.variables for n in v.elements if v.unit and n in own}
    starts = {s.name: float(s.guess(np.zeros(1))[0]) for s in stages.phase.states} | dict(estimates)
    return SampledCode(
        name=mpc.name, given=(*mpc.states, *known), find=mpc.inputs, period=mpc.period, units=units, starts=starts,
        header=header, source=source,
    )  # fmt: skip


def _filled(name: str, told: Mapping[str, str]) -> str:
    """A template with its words replaced."""
    text = (TEMPLATES / name).read_text(encoding="utf-8")
    for word, value in told.items():
        text = text.replace(word, value)
    return text


def stage_point(stages: HorizonStages, terminal: Terminal) -> ca.Function:
    """All that linearisation needs of one point, and, where the end costs something, its gradient and Hessian there."""
    y, t, courses = stages.symbols
    found = stages.point(y, t, courses)
    if terminal.there:
        found = [*found, *terminal.derivatives(y, t, courses)]
    return ca.Function("mpc_point", [y, t, courses], [ca.densify(one) for one in found], {"cse": True})


def _rows(mpc: Any, soft: np.ndarray) -> list[str]:
    """Limits of a stage of the program, each with one end."""
    stages, moves, found = mpc.stages, mpc.moves, []
    paths = len(stages.path)
    for k, ends in enumerate(zip(*stages.rows, strict=True)):
        found += _ends("MPC_PATH", k // paths, k % paths, ends, int(soft[k]))
    for k, ends in enumerate(zip(stages.lower_u, stages.upper_u, strict=True)):
        found += _ends("MPC_INPUT", 0, k, ends)
    for k in moves.limited:
        found += _ends("MPC_MOVE", 0, k, (moves.lower[k], moves.upper[k]))
    slacks = int(soft.max(initial=-1)) + 1
    return [*found, *(f"{{MPC_SLACKNESS, 0, {k}, -1, 0, 0.0}}" for k in range(slacks))]


def _ends(kind: str, point: int, index: int, ends: tuple[float, float], soft: int = -1) -> list[str]:
    return [
        f"{{{kind}, {point}, {index}, {sign}, {soft + 1}, {float(end)!r}}}"
        for sign, end in zip((-1, 1), ends, strict=True)
        if np.isfinite(end)
    ]


def _tables(mpc: Any, rows: list[str], first: PlannedMotion) -> Iterable[str]:
    stages: HorizonStages = mpc.stages
    signals = stages.nx + stages.nz + stages.nu
    P, rest = _rest(mpc.steady, stages)
    moves = mpc.moves
    yield f"static const mpc_row mpc_rows[] = {{{', '.join(rows) or '{MPC_PATH, 0, 0, 1, 0, 0.0}'}}};"
    yield _integers("mpc_every", range(signals))
    yield _integers("mpc_costly", stages.costly)
    yield _integers("mpc_chosen", moves.chosen)
    yield _numbers("mpc_weights", moves.weights)
    yield _numbers("mpc_lower_move", moves.lower)
    yield _numbers("mpc_upper_move", moves.upper)
    yield _numbers("mpc_lower_u", stages.lower_u)
    yield _numbers("mpc_upper_u", stages.upper_u)
    yield _numbers("mpc_sizes_x", stages.sizes_x)
    yield _numbers("mpc_sizes_u", stages.sizes_u)
    yield _numbers("mpc_rest_x", rest)
    yield _numbers("mpc_rest_P", P, "[NX]")
    yield _numbers("mpc_first_x", first.x, "[NX]")
    yield _numbers("mpc_first_w", first.w, "[NW]")
    yield _numbers("mpc_first_u", first.u, "[NU]")


def _rest(steady: SteadyState | None, stages: HorizonStages) -> tuple[np.ndarray, np.ndarray]:
    """The cost of a distance from the state of rest, and the state of rest; ModelError where it moves with time."""
    if steady is None:
        return np.zeros((stages.nx, stages.nx)), np.zeros(stages.nx)
    if steady.changes:
        raise ModelError(
            "terminal='lqr' and a state of rest that moves with time, expected one that stays for C; give the end a cost by "
            "objective() instead",
            place=stages.problem.name,
        )
    start = np.array([s.guess(np.zeros(1))[0] for s in stages.phase.states]) / stages.sizes_x
    return steady.at(0.0, start)


def _numbers(name: str, values: Any, columns: str = "") -> str:
    """A table row by row, with NAN for what is not known."""
    words = {"nan": "NAN", "inf": "INFINITY", "-inf": "-INFINITY"}

    def row(numbers: Iterable[float]) -> str:
        return "{" + (", ".join(words.get(repr(float(v)), repr(float(v))) for v in numbers) or "0") + "}"

    inside = row(values) if not columns else "{" + ", ".join(row(one) for one in values) + "}"
    return f"static const double {name}[]{columns} = {inside};"


def _integers(name: str, values: Iterable[int]) -> str:
    return f"static const int {name}[] = {{{', '.join(str(int(v)) for v in values) or '0'}}};"
