"""Forces of a robot, their slopes with parameters, and its actuators, as one CasADi function of a motion.

    f = Y(x, x', x'') p,   friction  f_c tanh(q' / v_s) + f_v q'

x is the tool, or the actuators. Slopes are those of the model's own equations; the sign of Coulomb friction is smooth here,
so that designs have gradients, and v_s is told.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau import ModelError
from gantrytau.border.refusal import did_you_mean
from gantrytau.dae import Dae
from gantrytau.describing.record import Record
from gantrytau_optimica.identification.friction.carried_mass import PLATE, driven_coordinates

WORDS = {"cart_masses": "carts[{}].m", "link_masses": "arms[{}].link_mass"}
FRICTION = re.compile(r"\.((?:f|tau)_[cvs])(\[\d+\])?$")


@dataclass(frozen=True, eq=False)
class MotionRegressor(Record):
    """function: motion (3 m,) to q (n,), q', q'', f (n,) of the nominal model and Y (n, k).

    names: parameters, k; nominal: their values in the model; actuators, coordinates: scalar names, n.
    """

    function: ca.Function
    names: tuple[str, ...]
    nominal: np.ndarray
    actuators: tuple[str, ...]
    coordinates: tuple[str, ...]

    def rows(self, motion: np.ndarray) -> tuple[np.ndarray, ...]:
        """q, q', q'', f (N, n) and Y (N, n, k) of motions (N, 3 m): positions, speeds, accelerations."""
        found = [np.asarray(x) for x in self.function.map(len(motion))(motion.T)]
        n, k = len(self.actuators), len(self.names)
        Y = found[4].reshape(n, len(motion), k).transpose(1, 0, 2)
        return (*(x.T for x in found[:4]), Y)


def known_parameters(dae: Dae) -> dict[str, str]:
    """Names of masses and friction, by what they are called in the model; friction by its actuator, `coulomb[i]`."""
    found = {"plate_mass": next((name for name in PLATE if name in dae.adjustable), "")}
    for word, pattern in WORDS.items():
        found |= {f"{word}[{i}]": pattern.format(i) for i in range(len(dae.inputs))}
    found = {name: there for name, there in found.items() if there in dae.adjustable}
    for word in ("coulomb", "viscous"):
        found |= {f"{word}[{i}]": "" for i in range(len(dae.inputs))}
    return found


def motion_regressor(
    dae: Dae, given: Sequence[str], parameters: Sequence[str] | None, smooth: float
) -> MotionRegressor:
    """The regressor over a motion of `given`, scalar names; parameters: None for all; smooth: v_s in m/s.

    Raises ModelError for names of parameters that are not known, StructureError where `given` does not tell the motion.
    """
    known = known_parameters(dae)
    names = tuple(known) if parameters is None else tuple(parameters)
    strange = [name for name in names if name not in known]
    if strange or not names:
        raise ModelError(
            f"design_excitation: found parameters={list(names)!r}, expected names among {', '.join(known)}"
            + (did_you_mean(strange[0], list(known)) if strange else ""),
            argument="parameters",
        )
    coordinates, n = driven_coordinates(dae), len(dae.inputs)
    motion = [pattern.format(name) for pattern in ("{}", "der({})", "der(der({}))") for name in given]
    adjusted = [known[name] for name in names if known[name]]
    moved = [pattern.format(name) for pattern in ("{}", "der({})", "der(der({}))") for name in coordinates]
    off = [name for name in dae.adjustable if FRICTION.search(name)]
    whole = dae.function(given=[*motion, *adjusted, *off], find=[*moved, *dae.inputs])
    try:
        whole, kind = whole.expand(), ca.SX
    except RuntimeError:  # loops that are solved by a call
        kind = ca.MX
    x, p = kind.sym("x", len(motion)), kind.sym("p", len(adjusted))
    values = [float(dae.parameter_values[name]) for name in off]

    def evaluated(friction: Sequence[float]) -> list:
        return whole.call([*ca.vertsplit(x), *ca.vertsplit(p), *[kind(float(each)) for each in friction]])

    bare, full = evaluated([0.0] * len(off)), evaluated(values)
    speeds = ca.vertcat(*bare[n : 2 * n])
    slopes = ca.densify(ca.jacobian(ca.vertcat(*bare[3 * n :]), p))
    columns, count = [], 0
    for name in names:
        if known[name]:
            columns.append(slopes[:, count])
            count += 1
        else:
            i = int(name.partition("[")[2][:-1])
            v = speeds[i]
            column = kind.zeros(n, 1)
            column[i] = ca.tanh(v / smooth) if name.startswith("coulomb") else v
            columns.append(column)
    nominal = np.array([dae.parameter_values[name] for name in adjusted], dtype=float)
    parts = [*(ca.vertcat(*bare[j * n : (j + 1) * n]) for j in range(3)), ca.vertcat(*full[3 * n :])]
    inner = ca.Function("Y", [x, p], [*parts, ca.horzcat(*columns)])
    z = kind.sym("x", len(motion))
    function = ca.Function(
        "Y", [z], [ca.densify(each) for each in inner.call([z, kind(ca.DM(nominal))])], {"cse": True}
    )
    return MotionRegressor(function, names, _nominal(dae, names, known), tuple(dae.inputs), coordinates)


def _nominal(dae: Dae, names: Sequence[str], known: dict[str, str]) -> np.ndarray:
    """Values of the model; friction by the law beside the actuator, zero where it has none."""
    found = []
    for name in names:
        there = known[name]
        if not there:
            owner = dae.inputs[int(name.partition("[")[2][:-1])].rpartition(".")[0]
            ends = ("f_c", "tau_c") if name.startswith("coulomb") else ("f_v", "tau_v")
            there = next((f"{owner}.law.{end}" for end in ends if f"{owner}.law.{end}" in dae.adjustable), "")
        found.append(float(dae.parameter_values[there]) if there else 0.0)
    return np.array(found)
