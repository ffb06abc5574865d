"""Whether a calibration is good enough: decided by poses that were not fitted, and by how sure the tool is everywhere."""

from dataclasses import dataclass

from gantrytau import GantryTauError
from gantrytau.border import Given, Sentence
from gantrytau.border.checks import number
from gantrytau.describing.record import Record
from gantrytau_optimica.calibration.assessment.cross_validation import CrossValidation, held_out
from gantrytau_optimica.calibration.calibration import Calibration
from gantrytau_optimica.calibration.design.identifiability import PoseArrays
from gantrytau_optimica.calibration.diagnostics.tool_error import Loose, ToolError, tool_error
from gantrytau_optimica.calibration.links.groups import TAPE
from gantrytau_optimica.calibration.named.named_calibration import NamedCalibration
from gantrytau_optimica.fitting.finding import Finding, length_text

SHOWN = 3  # combinations that are named
MEASURE = "measure the poses that are missing, or plan again with more of them"
NOTHING_MEASURED = 1e3  # m, noise with which poses tell nothing


@dataclass(frozen=True, eq=False)
class Verdict:
    """good: whether the tool keeps the wanted error (m); reasons: sentences with the numbers, and what to do."""

    good: bool
    wanted: float
    reasons: tuple[str, ...]

    def __str__(self) -> str:
        return f"{'good' if self.good else 'not good enough'}: {' '.join(self.reasons)}"


@dataclass(frozen=True, eq=False)
class CalibrationVerdict(Record, Verdict):
    """Verdict on a measured calibration.

    validation_error: mean error of poses that were not fitted, m, NaN where there are none; expected_error: of the tool, in
    the mean over the places where it is to work, m.
    """

    validation_error: float
    expected_error: float


def judge(
    found: Calibration | NamedCalibration | CrossValidation,
    wanted: float,
    *,
    expected: ToolError | None = None,
    tape: float = TAPE,
) -> CalibrationVerdict:
    """Whether a calibration is good enough: poses that were not fitted and the tool must err by no more than is wanted.

        verdict = judge(cross_validate(robot, measurements), wanted=200e-6)
        print(verdict)

    found: a calibration with poses held out, or one that was cross-validated; wanted: mean error of the tool, m; expected:
    the error of the tool where it is to work, by default at the poses that were fitted; tape: standard deviation of
    nominal values, m. Raises ModelError for models that no robot can hold, where `expected` is not given.
    """
    tape = number("judge", "tape", tape, above=0.0)
    wanted = number("judge", "wanted", wanted, above=0.0)
    checked = found if isinstance(found, CrossValidation) else held_out(found)
    fit = checked.calibration
    named = isinstance(fit, NamedCalibration)
    where = (
        "at the fitted poses" if named else "over all planned poses" if expected else "over the fitted poses"
    )
    error = float(fit.expected.mean()) if named else (expected or expected_error(fit, tape=tape)).error
    good = bool(fit.success and checked.error <= wanted and error <= wanted)
    words = (
        f"{_validated(checked)}, {length_text(error)} of the tool are expected {where} by what was measured, "
    )
    words += f"{length_text(wanted)} were wanted"
    if not good:
        advice = "name more parameters, or measure more poses" if named else MEASURE
        words += f"; look at the findings, {advice}"
    return CalibrationVerdict(good, wanted, (f"{words}.", _of_frame(fit, good, tape)), checked.error, error)


def _of_frame(found: Calibration | NamedCalibration, good: bool, tape: float) -> str:
    """What a verdict means for coordinates in the base of the robot."""
    if found.frame == "base":
        return "Poses were measured in the base of the robot: its coordinates are as good as this."
    if isinstance(found, NamedCalibration):
        return (
            "Coordinates of the base follow by frame.R and frame.t, which were fitted beside the parameters."
        )
    holds = "This is good up to a frame" if good else "This holds up to a frame"
    if found.motion is None:
        taken = f"{holds}: coordinates are those of the frame measured, taken for the base of the robot; "
        return Sentence(taken, Given("frame", "base"), " says that it is.")
    before = expected_error(found, tape=tape, noise=NOTHING_MEASURED)
    return Sentence(
        f"{holds}: R and t follow from nominal values, so that in coordinates of the base the tool may be off by "
        f"{length_text(before.error)}, as before, where these are {length_text(tape)} off; measure in the base of the robot "
        "and take ",
        Given("frame", "base"),
        " to know it there.",
    )


def expected_error(found: Calibration, *, tape: float = TAPE, noise: float | None = None) -> ToolError:
    """The error of the tool to be expected at the poses that were fitted.

    tape: deviation of nominal values, m; noise: of a measured coordinate, m, by default what explains what is left.
    """
    data = found.measurements.select(found.rows)
    poses = PoseArrays(data.q, data.r, data.R if found.plate_turns else None)
    noise = float(found.noise if noise is None else noise)
    return tool_error(found.robot, poses, poses, noise=noise, tape=tape, certainty=data.certainty)


def _validated(checked: CrossValidation) -> str:
    if not checked.good.size:
        return "no poses that were not fitted validate this"
    count = len(checked.calibration.left_out)
    without = f", {_outliers(count)} left out" if count else ""
    return f"{length_text(checked.error)} in the mean of poses that were not fitted{without}"


def _outliers(count: int) -> str:
    words = ("no", "one", "two", "three", "four", "five", "six")
    return f"{words[count] if count < len(words) else count} outlier{'' if count == 1 else 's'}"


def told_by_tool(
    found: Calibration, expected: ToolError | None = None, *, least: float | None = None, tape: float = TAPE
) -> Calibration:
    """The calibration, whose finding "undetermined" says what of it moves the tool: the rest is harmless.

    expected: by default at the poses that were fitted; least: m, by which the tool must move to be worth a word, by default
    the noise; tape: deviation of nominal values, m.
    """
    tape = number("told_by_tool", "tape", tape, above=0.0)
    least = None if least is None else number("told_by_tool", "least", least, least=0.0)
    if isinstance(found, NamedCalibration):  # its words are those of the numbers already
        return found
    if expected is None:
        try:
            expected = expected_error(found, tape=tape) if found.undetermined else None
        except GantryTauError:  # no robot can hold what was found
            expected = None
    if expected is None:
        return found
    moving = [one for one in expected.loose if one.moves > (found.noise if least is None else least)]
    if not found.undetermined and not moving:
        return found
    others = [f for f in found.findings if f.kind != "undetermined"]
    if not expected.loose:
        return found.with_findings(others)
    words = _loose(moving, len(expected.loose) - len(moving), tape)
    return found.with_findings([*others, Finding("undetermined", found.rows, words)])


def _loose(moving: list[Loose], quiet: int, tape: float) -> str:
    harmless = f"{quiet} combinations of numbers are known by nominal values alone, but do not move the tool"
    if not moving:
        return f"{harmless}: this is harmless"
    shown = "; ".join(f"{', '.join(one.names)} by {length_text(one.moves)}" for one in moving[:SHOWN])
    more = f"; and {len(moving) - SHOWN} more" if len(moving) > SHOWN else ""
    found = (
        f"data do not hold all that moves the tool; where nominal values are {length_text(tape)} off, together "
        f"{shown}{more}; measure more poses, spread over the workspace"
    )
    return f"{found}. {harmless}" if quiet else found
