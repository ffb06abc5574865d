"""Friction that sticks, for a simulation: its force as an unknown, its mode as a Discrete that whens set.

While it slides, mode 1 or -1, force = mode * coulomb + smooth; while it sticks, mode 0, the force is what keeps the speed at
zero. A sliding one locks where its speed comes to zero, a locked one breaks away where |force| passes its limit. Speeds of
what sticks are held at zero by projection, as constraints are.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from gantrytau.compiler.symbol_spaces import column
from gantrytau.compiler.translated import Translated
from gantrytau.compiler.translation import translate_flat
from gantrytau.flattening.flat_model import FlatModel, FlatVariable, When
from gantrytau.language.statements import Equation
from gantrytau.language.symbols import derivative_name
from gantrytau.simulation.singular_poses import Point

HOLDS = 1 + 1e-9  # times the breakaway force: more, and it is not rounding
AT_REST = 1e-12  # of the terms of a speed at the start
SHARED = (
    "where it sticks nothing decides what the force is: the speed is given, or others hold it, too; expected one friction "
    "for each motion, of a speed that forces decide"
)
WHENS = 3  # of each friction: lock, break away forward, backward


@dataclass(frozen=True, eq=False)
class Slips:
    """The frictions of a model in a simulation.

    modes: places of their modes in w, a slice; columns: of the velocities in x; still: x, time, t0, w -> the constraints of
    velocities, then the speeds of the frictions, and their slopes by these velocities; loads: x, z, time, t0, w -> forces
    in breakaway forces; first: place of their whens, of which each has `WHENS` in a row.
    """

    modes: slice
    columns: np.ndarray
    still: ca.Function
    loads: ca.Function
    first: int

    def __len__(self) -> int:
        return self.modes.stop - self.modes.start

    def sliding(self, x: np.ndarray, t: float, w: np.ndarray, sizes: np.ndarray) -> np.ndarray:
        """The modes that speeds ask for: 1, -1, and 0 at rest; sizes: of the states."""
        residual, slopes = (np.array(f)[-len(self) :] for f in self.still(x, t, t, w))
        terms = np.abs(slopes) @ np.maximum(np.abs(x), sizes)[self.columns]
        speeds = residual.ravel()
        return np.where(np.abs(speeds) <= AT_REST * terms, 0.0, np.sign(speeds))

    def held(self, x: np.ndarray, t: np.ndarray, w: np.ndarray) -> np.ndarray:
        """The nearest points, (points, n), at which velocities agree and what sticks rests, by the modes of the first."""
        stuck = np.flatnonzero(w[0, self.modes] == 0)
        if not stuck.size:
            return x
        residual, slopes = (np.array(f) for f in self.still(x.T, t[None], t[None], w.T))
        slopes = slopes.reshape(len(residual), len(x), len(self.columns)).transpose(1, 0, 2)
        rows = np.concatenate([np.arange(len(residual) - len(self)), len(residual) - len(self) + stuck])
        x = x.copy()
        for k in range(len(x)):  # velocities stand in them linearly
            x[k, self.columns] -= np.linalg.lstsq(slopes[k, rows], residual[rows, k], rcond=1e-12)[0]
        return x

    def loaded(self, point: Point) -> np.ndarray:
        """Forces of the frictions in breakaway forces; not finite where they have no hold on their speeds."""
        x, z, t, w = point
        return np.array(self.loads(x, z, t, t, w)).ravel()

    def postponed(self, rose: np.ndarray, point: Point) -> np.ndarray:
        """Which whens wait for the next round: what locks comes first, then the worst of those that break away."""
        waits = np.zeros(rose.size, dtype=bool)
        own = self.first + np.arange(WHENS * len(self)).reshape(-1, WHENS)
        away = own[:, 1:][rose[own[:, 1:]]]
        if rose[own[:, 0]].any():
            waits[away] = True
        elif away.size > 1:
            loads = np.abs(self.loaded(point))
            worst = away[np.argmax(loads[(away - self.first) // WHENS])]
            waits[away[away != worst]] = True
        return waits


def with_sticking(dae: Translated) -> Translated:
    """The same model with forces of frictions as unknowns, and their modes as Discretes."""
    if not dae.flat.frictions:
        return dae
    key = "frictions with modes"
    if key not in dae.made:
        dae.made[key] = translate_flat(_written(dae.flat), dae.request)
    return dae.made[key]


def _written(flat: FlatModel) -> FlatModel:
    """A flat model without frictions that stick, but with equations and whens of them."""
    symbols = {n: s for v in flat.variables for n, s in zip(v.elements, v.symbol.elements(), strict=True)}
    forces = {f.force for f in flat.frictions}
    variables = [replace(v, undetermined=SHARED) if forces & {*v.elements} else v for v in flat.variables]
    equations, whens = list(flat.equations), list(flat.whens)
    derivatives, modes = dict(flat.derivatives), flat.friction_modes
    for friction, name in zip(flat.frictions, modes, strict=True):
        rate = derivative_name(friction.speed, 1)
        mode, force = ca.SX.sym(name), symbols[friction.force]
        speed, gain = symbols[friction.speed], derivatives.setdefault(rate, ca.SX.sym(rate))
        words = f"whether {friction.force} slides forward (1), backward (-1) or sticks (0)"
        variables.append(
            FlatVariable(name, "discrete", (), (name,), mode, "1", words, (ca.SX(0),), owner=friction.path)
        )
        slides, where = mode**2, (friction.path, friction.model, 0)
        law = slides * (force - friction.smooth) - mode * friction.coulomb + (1 - slides) * gain
        equations.append(Equation(law, ca.SX(0), *where, label=friction.label))
        limit = HOLDS * friction.breakaway
        jumps = ((mode * speed < 0, 0), ((1 - slides) * (force - limit) > 0, 1))
        jumps = (*jumps, ((1 - slides) * (-force - limit) > 0, -1))
        for condition, value in jumps:
            after = len(whens) - 1 if value else -1
            whens.append(When(condition, (), ((name, ca.SX(value)),), "", *where, after=after))
    return replace(
        flat,
        variables=tuple(variables),
        equations=tuple(equations),
        derivatives=derivatives,
        whens=tuple(whens),
        discretes=(*flat.discretes, *modes),
        frictions=(),
        slips=flat.frictions,
    )


def slips_of(
    dae: Translated,
    inserted: Callable[[Sequence[ca.SX]], list[ca.SX]],
    arguments: Sequence[ca.SX],
    constraints: ca.SX,
    held: int,
) -> Slips:
    """The frictions in the symbols of a simulation: arguments x, z, time, t0, w, to which `inserted` leads.

    constraints: of velocities; held: place of the Discretes in w.
    """
    slips = dae.flat.slips
    symbols = {n: s for v in dae.flat.variables for n, s in zip(v.elements, v.symbol.elements(), strict=True)}
    ratios = [symbols[one.force] / (one.breakaway + 1e-300) for one in slips]
    speeds, loads = inserted(
        [column([dae.expression(one.speed) for one in slips]), dae.to_reduced(column(ratios))]
    )
    x, _, *rest = arguments
    rows = ca.densify(ca.vertcat(constraints, speeds))
    slopes = ca.jacobian(rows, x)
    tops = {derivative_name(n, top - 1) for n, top in dae.indexed.orders.items() if top}
    columns = [k for k, s in enumerate(x.elements()) if s.name() in tops and slopes[:, k].nnz()]
    begin = held + len(dae.flat.discretes) - len(slips)
    return Slips(
        slice(begin, begin + len(slips)),
        np.array(columns, dtype=int),
        ca.Function("still", [x, *rest], [rows, ca.densify(slopes[:, columns])], {"cse": True}),
        ca.Function("loads", list(arguments), [ca.densify(loads)], {"cse": True}),
        len(dae.flat.whens) - WHENS * len(slips),
    )
