"""Several ways to learn one motion, run one after the other: Dressler (2012), Table 7.2."""

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from gantrytau import ModelError
from gantrytau.describing.record import Record
from gantrytau_optimica.learning.cases.rig_file import CaseOfFile, RigFile
from gantrytau_optimica.learning.design.design_q import design_q
from gantrytau_optimica.learning.estimators.estimator import Estimator
from gantrytau_optimica.learning.estimators.estimators import Actuators, Complementary, Kinematic, Measured
from gantrytau_optimica.learning.estimators.kalman import Kalman
from gantrytau_optimica.learning.filters.zero_phase import ZeroPhase
from gantrytau_optimica.learning.laws.correction_laws import Gradient, NormOptimal
from gantrytau_optimica.learning.laws.learning import Learning
from gantrytau_optimica.learning.runs.estimated_response import arm_model, estimated_response
from gantrytau_optimica.learning.runs.history import History
from gantrytau_optimica.learning.runs.learn import RUNS, LearningError, learn
from gantrytau_optimica.learning.runs.robot_runs import Plant
from gantrytau_optimica.learning.runs.run_checks import check_window

SETTLED = 5  # runs, after which errors are averaged in Table 7.2


@dataclass(frozen=True)
class LearntCases(Record):
    """Histories by the names of cases. As a text: sigma, and errors of the tool in % of the first run.

    fitted: what numbers of the robot are fitted to printed results, as its record says.
    """

    histories: dict[str, History] = field(default_factory=dict)
    fitted: str = ""

    def settled(self, name: str) -> np.ndarray:
        """Errors of the tool, (3,) in % of the first run, in the mean from run 5 on, or of the last."""
        relative = self.histories[name].tool_relative
        return relative[min(SETTLED, len(relative) - 1) :].mean(axis=0)

    def __str__(self) -> str:
        width = max([4, *(len(name) for name in self.histories)])
        axes = sorted({k for history in self.histories.values() for k in history.reference.moving})
        lines = [f"{'case':<{width}}   sigma" + "".join(f"{f'tool {chr(120 + k)} [%]':>13}" for k in axes)]
        for name, history in self.histories.items():
            sigma = "      -" if history.stability is None else f"{history.stability.sigma:7.3f}"
            lines.append(f"{name:<{width}} {sigma}" + "".join(f"{x:13.1f}" for x in self.settled(name)[axes]))
        few = any(len(history) <= SETTLED for history in self.histories.values())
        when = "of the last run" if few else f"in the mean from run {SETTLED} on"
        lines.append(f"Errors of the tool in % of the first run, {when}")
        return "\n".join([*lines, self.fitted]).strip()


def learn_cases(
    rig: RigFile,
    *,
    folder: Path | None = None,
    force: bool = False,
    progress: Callable[[str], None] | None = None,
) -> LearntCases:
    """Learn the motion of a file in all its ways.

    folder: where the history of each is kept, `case-NAME.npz`, and gone on from; force: learn what diverges, too; progress:
    is told what begins. Raises what `learn` and `design_q` raise, and ModelError for histories of other laws or estimators.
    """
    plant = rig.plant()
    found: dict[str, History] = {}
    for case in rig.cases:
        tell = progress or _quietly
        try:
            found[case.name] = _learnt(case, plant, rig, folder, force, tell)
        except (ModelError, LearningError) as error:
            if isinstance(error.__cause__, KeyboardInterrupt):
                raise
            raise error.within(f"{rig.file}: case {case.name}") from error
    return LearntCases(found, rig.fitted)


def _learnt(
    case: CaseOfFile,
    plant: Plant,
    rig: RigFile,
    folder: Path | None,
    force: bool,
    tell: Callable[[str], None],
) -> History:
    file = None if folder is None else folder / f"case-{case.name}.npz"
    check_window(Learning(window=rig.window), rig.reference)
    tell(f"case {case.name}: what corrections do")
    estimator = _estimator(case, plant, rig)
    response = estimated_response(plant, rig.reference, estimator, seed=RUNS * rig.seed)
    law = {"gradient": Gradient(), "norm-optimal": NormOptimal()}.get(case.law)
    learning = Learning(case.gain, case.shift, window=rig.window, law=law)
    if case.open_to is not None:
        learning = replace(learning, q=design_q(response, limit=case.open_to, learning=learning))
    else:
        learning = replace(learning, q=ZeroPhase.butterworth(2, float(case.cut_off or 0.0)))
    if file is not None and file.exists():
        _check_kept(file, learning, estimator)
    tell(f"case {case.name}: {rig.iterations + 1} runs")
    return learn(
        plant,
        rig.reference,
        learning,
        estimator,
        iterations=rig.iterations,
        seed=rig.seed,
        response=response,
        force=force,
        history=file,
    )


def _check_kept(file: Path, learning: Learning, estimator: Estimator) -> None:
    """Raises ModelError for runs on file that were learnt in another way: their errors would stand beside a wrong sigma."""
    kept = History.load(file).settings
    for word, now in (("learning", repr(learning)), ("estimator", repr(estimator))):
        if _rounded(str(kept.get(word))) != _rounded(now):
            raise ModelError(
                f"learn: found {file} by another {'gain, shift, law, Q or window' if word == 'learning' else word}, "
                "expected what learns now; take another folder, or remove the file",
                argument="history",
            )


def _rounded(words: str) -> str:
    """With numbers to three digits, as a Q that is designed elsewhere may differ in the last ones."""
    return re.sub(r"\d+\.\d+(e[-+]?\d+)?", lambda number: f"{float(number[0]):.3g}", words)


def _quietly(words: str) -> None:
    """Tell nobody."""


def _estimator(case: CaseOfFile, plant: Plant, rig: RigFile) -> Estimator:
    kinds = {
        "actuators": Actuators,
        "kinematic": Kinematic,
        "complementary": Complementary,
        "measured": Measured,
    }
    if case.estimator == "kalman":
        return Kalman(arm_model(plant, rig.reference, seed=RUNS * rig.seed))
    return kinds[case.estimator]()
