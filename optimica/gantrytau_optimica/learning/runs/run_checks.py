"""What learning and repeating refuse before a robot moves."""

import numpy as np

from gantrytau import ModelError, Result
from gantrytau.border.checks import instance, whole
from gantrytau_optimica.learning.estimators.estimator import Estimator
from gantrytau_optimica.learning.laws.learning import Learning
from gantrytau_optimica.learning.runs.corrections import Corrections
from gantrytau_optimica.learning.runs.history import History
from gantrytau_optimica.learning.runs.reference import Reference
from gantrytau_optimica.learning.runs.robot_runs import Plant

SAME = 1e-9  # m, by which references may differ


def check_kinds(rig: object, reference: object, learning: object, estimator: object) -> None:
    """Raises ModelError for arguments of other kinds."""
    lacking = [word for word in ("run", "period", "kinematics") if not hasattr(rig, word)]
    if lacking:
        raise ModelError(
            f"learn: found {rig!r} without {', '.join(lacking)}, expected a Rig or another plant",
            argument="rig",
        )
    instance("learn", "reference", reference, Reference, "one such as square_reference(0.01)")
    instance("learn", "learning", learning, Learning, "one such as Learning(window=Tukey(1.2, 4.5))")
    instance("learn", "estimator", estimator, Estimator, "one such as Actuators()")


def check_window(learning: Learning, reference: Reference) -> None:
    """Raises ModelError for a window that does not fit the run, or applies nowhere in full."""
    if not learning.window.full(len(reference), reference.period).any():
        raise ModelError(
            "learn: found a window whose flanks meet, expected samples where corrections apply in full, by which errors are "
            "judged; take a shorter lead",
            argument="learning",
        )


def check_runs(verb: str, rig: Plant, reference: Reference, **counts: int) -> None:
    """Raises ModelError for counts that are none, by their names, and for a reference of another period than the rig's."""
    for name, value in counts.items():
        whole(verb, name, value, least=0)
    if abs(reference.period - rig.period) > 1e-6 * rig.period:
        raise ModelError(
            f"{verb}: found a reference every {reference.period:g} s, expected every {rig.period:g} s as the rig; sample it "
            "again",
            argument="reference",
        )


def check_run(run: Result, samples: int, plant: Plant) -> None:
    """Raises ModelError for a run of another length than its reference, or without the positions of the joints."""
    place = f"{type(plant).__name__}.run"
    if "measured.q" not in run.names and "measured.q[0]" not in run.names:
        raise ModelError(f"{place}: found no measured.q, expected the measured positions of the joints")
    if len(run.time) != samples:
        raise ModelError(
            f"{place}: found {len(run.time)} rows, expected {samples}, one for each of the reference",
            argument="rig",
        )


def check_history(history: History, reference: Reference, corrections: Corrections) -> None:
    """Raises ModelError for a history of another reference, robot or estimator."""
    old = history.reference
    if len(old) != len(reference) or np.abs(old.r - reference.r).max() > SAME:
        raise ModelError(
            "learn: found a reference that is not the one of the history, expected the same, as corrections belong to it; "
            "start without history",
            argument="reference",
        )
    if history.joints != corrections.kinematics.joints:
        raise ModelError(
            f"learn: found a history of a robot with {', '.join(history.joints)}, expected one with "
            f"{', '.join(corrections.kinematics.joints)}; start without history",
            argument="history",
        )
    if history.names != corrections.names:
        raise ModelError(
            f"learn: found a history of {', '.join(history.names)} and an estimator of {', '.join(corrections.names)}, "
            "expected the same corrections; start without history",
            argument="history",
        )
