"""Moves of inputs from one sample to the next: limits of their rates, penalties, and blocks over which inputs are held.

The input before a stage, v, becomes a state of the quadratic program, v_next = u, which the controller knows from what it
applied last. Where an input is held, u = v leaves no choice; all changes are to the plan, whose inputs are u_plan:

    (x, u) = (x, v + o),  v_next = v + o,  o = u_plan before - u_plan        held
    low <= u - v - o <= high,  cost weight (u - v - o)^2                     chosen anew
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import array, instance, number, whole
from gantrytau.border.dimensions import per_second
from gantrytau.border.refusal import Given, did_you_mean
from gantrytau_optimica.predictive.horizon_qp import Found, Stage
from gantrytau_optimica.predictive.stages import HorizonStages


class Moves:
    """What is asked of moves over a horizon of so many stages, in scaled inputs.

    rates: input -> largest rate or (lowest, highest), unit/s; penalties: input -> weight of the square of a step.
    blocks: periods for which inputs are held, one number or one for each block, the last one to the end of the horizon.
    unit: of an input, by name.
    """

    def __init__(
        self,
        stages: HorizonStages,
        elements: int,
        rates: Mapping[str, Any],
        penalties: Mapping[str, float],
        blocks: int | Sequence[int],
        unit: Callable[[str], str | None],
    ):
        self.nx, self.nu = stages.nx, stages.nu
        names = tuple(s.name for s in stages.phase.inputs)
        self.lower, self.upper = np.full(self.nu, -np.inf), np.full(self.nu, np.inf)
        for name, found in _of_inputs(stages, "rates", rates, names).items():
            self.lower[names.index(name)], self.upper[names.index(name)] = _rate(
                name, found, per_second(unit(name) or "")
            )
        self.lower, self.upper = (ends * stages.step / stages.sizes_u for ends in (self.lower, self.upper))
        weights = np.zeros(self.nu)
        for name, found in _of_inputs(stages, "step_penalty", penalties, names).items():
            weights[names.index(name)] = number("Mpc", f"step_penalty[{name}]", found, least=0.0)
        self.weights = weights * stages.sizes_u**2
        self.chosen = _chosen(blocks, elements)
        self.limited = np.flatnonzero(np.isfinite(self.lower) | np.isfinite(self.upper))
        self.wanted = bool(self.limited.size or self.weights.any() or not self.chosen.all())

    def reached(self, u: np.ndarray, before: np.ndarray) -> np.ndarray:
        """Inputs (nu,) as near to u as their rates allow from those before."""
        return np.clip(u, before + self.lower, before + self.upper)

    def added(self, stage: Stage, u: np.ndarray, before: np.ndarray) -> Stage:
        """The program with the input before as further states, its moves limited. u (N, nu): planned; before: applied."""
        n, nx, nu = len(u), self.nx, self.nu
        chosen, eye = self.chosen[:, None, None], np.eye(nu)
        o = np.vstack([before, u[:-1]]) - u
        still = np.where(self.chosen[:, None], 0.0, o)
        T = np.zeros((n, nx + nu, nx + 2 * nu))  # (x, u) by (x, v, u)
        T[:, :nx, :nx] = np.eye(nx)
        T[:, nx:, nx : nx + nu], T[:, nx:, nx + nu :] = ~chosen * eye, chosen * eye
        offset = np.concatenate([np.zeros((n, nx)), still], axis=1)
        H = T.swapaxes(1, 2) @ stage.H @ T
        g = np.einsum("nij,ni->nj", T, stage.g + np.einsum("nij,nj->ni", stage.H, offset))
        move = np.hstack([np.zeros((nu, nx)), -eye, eye])
        H += chosen * (move.T * 2 * self.weights @ move)
        g -= 2 * self.chosen[:, None] * ((self.weights * o) @ move)
        whole = np.concatenate([stage.A, stage.B], axis=2) @ T
        after = np.concatenate([whole, T[:, nx:]], axis=1)
        b = np.concatenate([stage.b + np.einsum("nij,nj->ni", stage.B, still), still], axis=1)
        rows = np.concatenate([stage.C, stage.D], axis=2) @ T
        passed = np.einsum("nij,nj->ni", stage.D, still)
        rows = np.concatenate([rows, chosen * move[self.limited]], axis=1)
        # neither the move nor the input of a held stage stands in an equation: between any two limits they stay at 0
        low = np.where(self.chosen[:, None], self.lower + o, -1.0)[:, self.limited]
        high = np.where(self.chosen[:, None], self.upper + o, 1.0)[:, self.limited]
        lower_u = np.where(self.chosen[:, None], stage.lower_u, -1.0)
        upper_u = np.where(self.chosen[:, None], stage.upper_u, 1.0)
        return Stage(
            H, g, after[..., : nx + nu], after[..., nx + nu :], b, rows[..., : nx + nu], rows[..., nx + nu :],
            np.concatenate([stage.lower - passed, low], axis=1), np.concatenate([stage.upper - passed, high], axis=1),
            lower_u, upper_u,
        )  # fmt: skip

    def removed(self, found: Found, u: np.ndarray, before: np.ndarray) -> Found:
        """The answer to the program of `added`, in states and inputs of the problem."""
        o = np.vstack([before, u[:-1]]) - u
        held = found.x[:-1, self.nx :] + o
        return replace(found, x=found.x[:, : self.nx], u=np.where(self.chosen[:, None], found.u, held))


def _of_inputs(stages: HorizonStages, argument: str, found: Any, names: Sequence[str]) -> dict[str, Any]:
    instance("Mpc", argument, found, Mapping, "a mapping from names of inputs")
    for name in found:
        if name not in names:
            words = f"expected the inputs {', '.join(names)}{did_you_mean(str(name), names)}"
            raise ModelError(words, place=stages.problem.name, found=Given(argument, name))
    return dict(found)


def _rate(name: str, found: Any, unit: str) -> tuple[float, float]:
    """Lowest and highest rate, with 0 between them: an input must be allowed to stay."""
    if np.ndim(found) == 0 and found is not None:
        most = number("Mpc", f"rates[{name}]", found, unit=unit or None, above=0.0)
        return -most, most
    low, high = array("Mpc", f"rates[{name}]", found, (2,), unit=unit or None, finite=False)
    if not low <= 0.0 <= high or low == high:
        raise ModelError(
            "expected the lowest and the highest rate in unit/s, with 0 between them, as (-10.0, 5.0)",
            place="Mpc",
            found=Given(f"rates[{name}]", found),
        )
    return float(low), float(high)


def _chosen(blocks: int | Sequence[int], elements: int) -> np.ndarray:
    """Which stages of a horizon choose their inputs anew."""
    given = isinstance(blocks, Sequence | np.ndarray)
    lengths = [whole("Mpc", "blocks", one, least=1) for one in (blocks if given else [blocks])]
    if not lengths:
        raise ModelError("expected at least one block", place="Mpc", found=Given("blocks", blocks))
    if sum(lengths) > elements and given:
        words = f"expected blocks of {elements} periods together at most, the length of the horizon"
        raise ModelError(words, place="Mpc", found=Given("blocks", blocks))
    chosen = np.zeros(elements, dtype=bool)
    chosen[np.cumsum([0, *lengths[:-1]]) if given else slice(None, None, lengths[0])] = True
    return chosen
