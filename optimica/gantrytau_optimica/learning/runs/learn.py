"""Iterative learning control: a robot runs a reference again and again, and corrects it by the error it made.

Dressler (2012), chapter 7; Arimoto, Kawamura, Miyazaki (1984); Norrloef, Gunnarsson (2002).
"""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau import GantryTauError, ModelError, Result
from gantrytau.border.checks import whole
from gantrytau.border.refusal import USERS_ERRORS, Given
from gantrytau.progress import shows_progress, tell
from gantrytau_optimica.learning.estimators.estimator import Estimator, at_rest
from gantrytau_optimica.learning.estimators.estimators import Actuators
from gantrytau_optimica.learning.laws.learning import Learning, Stability
from gantrytau_optimica.learning.laws.lifted import Response, axes_of, period_of
from gantrytau_optimica.learning.runs.corrections import Corrections
from gantrytau_optimica.learning.runs.estimated_response import estimated_response
from gantrytau_optimica.learning.runs.history import History
from gantrytau_optimica.learning.runs.reference import Reference
from gantrytau_optimica.learning.runs.robot_runs import Plant
from gantrytau_optimica.learning.runs.run_checks import (
    check_history,
    check_kinds,
    check_run,
    check_runs,
    check_window,
)

RUNS = 100  # seeds apart, so that no two runs of a trial draw the same


class LearningError(GantryTauError):
    """Learning would diverge, or a run failed. history: the runs before it, None where there are none."""

    def __init__(self, *parts: str | Given, history: History | None = None, **facts: Any):
        super().__init__(*parts, **facts)
        self.history = history


@shows_progress
def learn(
    rig: Plant,
    reference: Reference,
    learning: Learning | None = None,
    estimator: Estimator | None = None,
    *,
    iterations: int = 10,
    seed: int = 0,
    response: Response | None = None,
    force: bool = False,
    history: History | str | os.PathLike[str] | None = None,
) -> History:
    """Run a reference, learn from the error, and run it again: runs 0 to `iterations`.

    rig: a `Rig` or any `Plant`; estimator: what is learnt from, by default the actuators, each for itself; others correct
    the reference of the tool along the axes in which it moves. response: from corrections to the estimate; by default it is
    measured first with a binary sequence (24 s of the robot's time at 4 ms), which also gives laws without a model theirs.
    It says whether learning converges: what diverges is refused unless force. history: runs to go on from, or a file (.npz)
    that is written after each run, and gone on from where it exists. Run k draws with the seed 100 seed + k.
    Raises ModelError for arguments that do not fit, LearningError for learning that would diverge, and for a run that
    fails, with all that was finished in `.history`.
    """
    whole("learn", "iterations", iterations, least=0)
    whole("learn", "seed", seed, least=0)
    learning = Learning() if learning is None else learning
    estimator = Actuators() if estimator is None else estimator
    check_kinds(rig, reference, learning, estimator)
    check_runs("learn", rig, reference)
    check_window(learning, reference)
    corrections = Corrections(rig.kinematics, estimator.joints, reference.moving)
    so_far, path = _kept(history)
    found = so_far or _started(rig, reference, learning, estimator, corrections)
    check_history(found, reference, corrections)
    found = _under(learning, found)
    if response is None:
        response = estimated_response(rig, reference, estimator, seed=RUNS * seed)
    learning = learning.with_response(response)
    stability = judged(learning, response, len(reference), corrections.count, rig.period)
    if stability.diverges and not force:
        remedy = Given("force", True)
        raise LearningError(
            f"{stability}; ", remedy, " runs it all the same", place="learn", argument="learning"
        )
    found = replace(found, stability=stability)
    for k in range(len(found), iterations + 1):
        tell(f"run {k} of {iterations}")
        found = _next_run(rig, found, learning, estimator, corrections, RUNS * seed + k)
        if path is not None:
            found.save(path)
    return found


def _kept(history: History | str | os.PathLike[str] | None) -> tuple[History | None, Path | None]:
    """The runs to go on from, and the file in which they are kept."""
    if history is None or isinstance(history, History):
        return history, None
    path = Path(history)
    return (History.load(path) if path.exists() else None), path


def _under(learning: Learning, found: History) -> History:
    """A history that goes on under this law: errors are judged where all corrections applied in full.

    Raises ModelError where the windows of both laws have no sample in common.
    """
    if found.settings.get("learning") == repr(learning):
        return found
    full = found.full & learning.window.full(len(found.full), found.reference.period)
    if not full.any():
        raise ModelError(
            "learn: found a window that nowhere applies in full where that of the history does, expected samples by which "
            "runs before and behind are judged; take the window of the history, or start without history",
            argument="learning",
        )
    return replace(
        found, full=full, settings=found.settings | dict(learning=repr(learning), since=len(found))
    )


def judged(learning: Learning, response: Response, samples: int, count: int, period: float) -> Stability:
    """Whether learning converges. Raises ModelError for a response of another period or number of axes."""
    if abs(period_of(response) - period) > 1e-9 * period:
        raise ModelError(
            f"learn: found a response sampled every {period_of(response):g} s, expected every {period:g} s as the rig; "
            "identify it again with this period",
            argument="response",
        )
    if axes_of(response) != count:
        raise ModelError(
            f"learn: found a response of {axes_of(response)} corrections, expected {count}",
            argument="response",
        )
    return learning.stability(response, samples)


def _started(
    rig: Plant, reference: Reference, learning: Learning, estimator: Estimator, corrections: Corrections
) -> History:
    """A history without runs."""
    n, m, N = len(rig.kinematics.joints), corrections.count, len(reference)
    return History(
        reference,
        rig.kinematics.joints,
        corrections.names,
        () if estimator.joints else corrections.picked,
        corrections.wanted(reference.r),
        learning.window.full(N, reference.period),
        dict(learning=repr(learning), estimator=repr(estimator), rig=repr(rig)),
        inputs=np.zeros((0, N, m)),
        q_ref=np.zeros((0, N, n)),
        q=np.zeros((0, N, n)),
        tool=np.zeros((0, N, 3)),
        estimates=np.zeros((0, N, m)),
        next_input=np.zeros((N, m)),
    )


def _next_run(
    rig: Plant, so_far: History, learning: Learning, estimator: Estimator, corrections: Corrections, seed: int
) -> History:
    """With the run that the corrections of the one before ask for. Raises LearningError where it fails."""
    k, u = len(so_far), so_far.next_input
    try:
        q_ref, v_ref = corrections.references(so_far.reference.r, u, rig.period)
        run = rig.run(q_ref, v_ref, seed=seed)
        check_run(run, len(so_far.reference), rig)
        estimate = estimator.estimate(run, rig.kinematics)[:, list(corrections.picked)]
        following = learning.next(u, so_far.wanted - estimate, rig.period)
    except (*USERS_ERRORS, KeyboardInterrupt) as error:  # of a plant that is not ours
        pressed = isinstance(error, KeyboardInterrupt)
        raise LearningError(
            f"learn: run {k} {'was interrupted' if pressed else 'failed'}, the {k} before it stand in .history"
            + ("" if pressed else f": {error if isinstance(error, GantryTauError) else repr(error)}"),
            history=so_far if k else None,
            argument=getattr(error, "argument", None),
        ) from error
    found = so_far.with_run(
        inputs=u,
        q_ref=q_ref,
        q=np.asarray(run["measured.q"]),
        tool=_tool(run, rig),
        estimates=estimate,
    )
    return replace(found, next_input=following)


def _tool(run: Result, rig: Plant) -> np.ndarray:
    """Where the tool was, (N, 3): as measured, set to the kinematics at rest, else by the kinematics alone."""
    z = rig.kinematics.fk(np.asarray(run["measured.q"]))[0]
    if not any(name.startswith("measured.r") for name in run.names):
        return z
    r, still = np.asarray(run["measured.r"]), at_rest(run)
    return r + np.mean((z - r)[still], axis=0)
