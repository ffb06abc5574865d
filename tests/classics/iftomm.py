"""The mechanisms of the IFToMM benchmark library by components, against their motion by other equations."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from gantrytau import Model, simulate, translate
from tests.classics import constrained, independent, mechanisms
from tests.classics.initial_values import SQUEEZER_ENDS
from tests.classics.lines import lines_of
from tests.classics.row import Row
from tests.classics.with_exudyn import by_exudyn

ALLOWED = 1e-3  # m, of the library at its higher precision
POINTS = 201


@dataclass(frozen=True)
class Mechanism:
    """A mechanism, the end of its run in s, and the point that is compared, in m.

    exact: the point at given times, s, or at the last ones; masses: bodies, whose energy must stay with that of
    `potential` beside gravity, J; policy: of the simulation.
    """

    name: str
    model: Callable[[], Model]
    source: Any
    stop: float
    point: str
    exact: Callable[[np.ndarray], np.ndarray]
    masses: tuple[str, ...] = ()
    gravity: tuple[float, float, float] = (0.0, -9.81, 0.0)
    potential: Callable[[Any], np.ndarray] | None = None
    policy: Mapping[str, Any] = field(default_factory=dict)
    tolerance: float = 1e-8
    note: str = ""


def _end_of_the_crank(times: np.ndarray) -> np.ndarray:
    beta = SQUEEZER_ENDS["beta.phi"]
    return 0.007 * np.array([[np.cos(beta), np.sin(beta), 0.0]])


def _of_drive_and_spring(result: Any) -> np.ndarray:
    return 4530 / 2 * (result["line.s"] - 0.07785) ** 2 - 0.033 * result["beta.phi"]


def _numbered(name: str, count: int) -> tuple[str, ...]:
    return tuple(f"{name}[{k}]" for k in range(count))


WINDOWS = 40
CROSSED = 'every bar is horizontal twice a turn, where the forces are not determined: `singular="cross"`'
STIFF = "springs of 8e5 N/m with dampers of 4e4 N.s/m, so that energy is lost"
PROBLEMS = (
    Mechanism(
        "SimplePendulum", mechanisms.SimplePendulum, mechanisms.SimplePendulum, 2000.0, "mass.frame_a.r",
        independent.pendulum, ("mass",), tolerance=1e-10, note="845 swings; closed form by elliptic functions",
    ),
    Mechanism(
        "NFourBar", lambda: mechanisms.windows(WINDOWS)(), mechanisms.windows, 20.0, "up[0].frame_b.r",
        partial(independent.windows, WINDOWS), (*_numbered("uprights", WINDOWS + 1), *_numbered("couplers", WINDOWS)),
        policy={"singular": "cross"}, note=CROSSED,
    ),
    Mechanism(
        "AndrewsSqueezer", constrained.Squeezer, constrained.Squeezer, 0.03, "r1.frame_b.r", _end_of_the_crank,
        tuple(f"k{k}" for k in range(1, 8)), (0.0, 0.0, 0.0), _of_drive_and_spring, note="data of the test set above",
    ),
    Mechanism(
        "Bricard", mechanisms.Bricard, mechanisms.Bricard, 10.0, "rods[2].frame_b.r", independent.bricard,
        _numbered("bodies", 5), note="one constraint of six repeats the others",
    ),
    Mechanism(
        "FlyballGovernor", mechanisms.FlyballGovernor, mechanisms.FlyballGovernor, 10.0, "slide.frame_b.r",
        independent.governor, note=STIFF,
    ),
)  # fmt: skip


def run(mechanism: Mechanism) -> Row:
    """The mechanism by components, and the same motion by other equations."""
    begin = time.process_time()
    translated = translate(mechanism.model())
    made = time.process_time()
    stop, tolerance = mechanism.stop, mechanism.tolerance
    result = simulate(translated, stop=stop, tolerance=tolerance, points=POINTS, **mechanism.policy)
    simulated = time.process_time()
    exact = mechanism.exact(result["time"])
    compared = time.process_time()
    found = np.asarray(result[mechanism.point]).reshape(result["time"].size, -1)
    error = _apart(found, exact)
    return {
        "bodies": sum(name.endswith(".m") for name in translated.parameters),
        "lines": lines_of(mechanism.source),
        "stop": stop,
        "tolerance": tolerance,
        "error": error,
        "drift": _drift(result, mechanism) if mechanism.masses else "",
        "steps": result.statistics.steps,
        "translate": round(made - begin, 3),
        "simulate": round(simulated - made, 3),
        "independent": round(compared - simulated, 3),
        "exudyn": by_exudyn(mechanism.name, stop, ALLOWED, lambda t, r: _apart(r, mechanism.exact(t))),
        "note": mechanism.note,
        "held": error <= ALLOWED,
    }


def _apart(found: np.ndarray, exact: np.ndarray) -> float:
    """Largest distance, of the coordinates and times that are known."""
    return float(np.max(np.linalg.norm(found[-len(exact) :, : exact.shape[1]] - exact, axis=1)))


def _drift(result: Any, mechanism: Mechanism) -> float:
    """Largest change of the energy, by the largest kinetic energy."""
    moving = lifted = np.zeros(result["time"].size)
    for name in mechanism.masses:
        mass, R, place = (result[f"{name}.{part}"] for part in ("m", "frame_a.R", "frame_a.r"))
        speed = result[f"{name}.v"]
        if f"{name}.r_cm" in result:
            arm = R @ result[f"{name}.r_cm"][..., None]
            place = place + arm[..., 0]
            spin = result[f"{name}.w"]
            speed = speed + np.cross(spin, arm[..., 0])
            own = np.einsum("kji,kj->ki", R, spin)
            moving = moving + np.einsum("ki,kij,kj->k", own, result[f"{name}.J"], own) / 2
        moving = moving + mass * np.sum(speed**2, axis=1) / 2
        lifted = lifted - mass * (place @ np.array(mechanism.gravity))
    whole = moving + lifted + (mechanism.potential(result) if mechanism.potential else 0.0)
    return float(np.abs(whole - whole[0]).max() / moving.max())
