"""Errors of simulations that stop before their end."""

from collections.abc import Sequence

from gantrytau.border.refusal import SolveError
from gantrytau.compiler.translated import Translated
from gantrytau.flattening.flat_model import When
from gantrytau.language.symbols import Range
from gantrytau.simulation.events.impulses import Infinite

REASONS = {
    "TOO_MUCH_WORK": "the steps became too small",
    "ERR_FAIL": "the steps became too small",
    "CONV_FAIL": "the equations of a step found no solution",
    "RHSFUNC": "the equations are not finite",
    "RES_FAIL": "the equations are not finite",
    "LSETUP_FAIL": "the equations of a step are singular",
    "LSOLVE_FAIL": "the equations of a step are singular",
}
KEPT = ".result holds the motion up to there"
NOT_FINITE = f"{KEPT}: look for a division by zero or a root of a negative number"
SMOOTH = "Smooth it, as tanh(x / small) for sign(x), or"


def _stop(dae: Translated, t: float, words: str, equations: Sequence[str] = ()) -> SolveError:
    return SolveError(f"{dae.name}: {words}", time=t, equations=list(equations))


def _at(dae: Translated, t: float, words: str, equations: Sequence[str] = ()) -> SolveError:
    return _stop(dae, t, f"at t = {t:.6g} s {words}; {KEPT}", equations)


def opened(dae: Translated, t: float, name: str) -> SolveError:
    """A loop opens because a constraint that was left out does not repeat others any more."""
    words = (
        f"after t = {t:.6g} s the loop opens: {name} was left out because it repeated other constraints at the start, and "
        f"it does not any more. Start nearer to that pose, where another choice is made; {KEPT}"
    )
    return _stop(dae, t, words, [name])


def singular_pose(dae: Translated, t: float, weakest: Sequence[str]) -> SolveError:
    """The motion meets a singular pose at time t, where these equations degenerate."""
    redundant = dae.redundant
    doubt = (
        f" (constraints were left out as redundant at the start: {redundant[0].name}{', ...' if redundant[1:] else ''}; "
        "if the mechanism is sound at that pose, start nearer to it, so that others are kept)"
        if redundant
        else ""
    )
    words = (
        f"the motion meets a singular pose at t = {t:.6g} s, where forces or accelerations are not determined. The "
        f"equations that degenerate there: {'; '.join(weakest)}. {KEPT}: keep away from that pose, change the geometry, "
        "or, where the motion goes on smoothly, cross it with the speeds before it, simulate(..., singular='cross')"
    )
    return _stop(dae, t, words + doubt, weakest)


def sampled_badly(dae: Translated, t: float, name: str) -> SolveError:
    """Error: a value sampled at time t is not finite."""
    return _stop(dae, t, f"{name} is sampled at t = {t:.6g} s, and its new value is not finite; {NOT_FINITE}")


def stopped(dae: Translated, t: float, error: Exception, endless: Sequence[str]) -> SolveError:
    """The integrator gives up at time t; endless: what has no finite value there, or just behind."""
    words = f"the integration stopped at t = {t:.6g} s: "
    if endless:
        shown = ", ".join(endless[:4]) + (", ..." if len(endless) > 4 else "")
        words += (
            f"behind it {shown} {'is' if len(endless) == 1 else 'are'} not finite. Look in what it follows from for a root "
            "or a logarithm of a number that becomes negative, or a division by zero; .result holds what was computed"
        )
        return _stop(dae, t, words, _origins(dae, endless))
    last = str(error).splitlines()[-1]
    reason = next((words for sign, words in REASONS.items() if sign in str(error)), last)
    words += (
        f"{reason}. The solution may grow beyond all limits there; .result holds what was computed: look at it, and "
        "shorten the time or change the inputs"
    )
    return _stop(dae, t, words)


def _origins(dae: Translated, names: Sequence[str]) -> list[str]:
    """The equations that give variables."""
    found = [o.equations for o in dae.origins if {dae.spoken(n) for n in (*o.tears, *o.inner)} & set(names)]
    return list(dict.fromkeys(e for equations in found for e in equations))


def chattering(dae: Translated, t: float, conditions: Sequence[str]) -> SolveError:
    """Conditions turn back and forth without end at time t."""
    words = (
        f"{' and '.join(conditions)} {'turns' if len(conditions) == 1 else 'turn'} back and forth without end: what holds "
        f"on either side leads back to the other. {SMOOTH} let it keep its side within a band; friction that sticks is "
        "stick_slip"
    )
    return _at(dae, t, words)


def never_past(dae: Translated, t: float, conditions: Sequence[str]) -> SolveError:
    """Conditions turn in intervals that shrink towards an instant, behind time t, which is not reached."""
    words = (
        f"{' and '.join(conditions)} turned thousands of times, in intervals that shrink towards an instant which is never "
        "reached: look for a pole, as of floor(1 / x), or a frequency that grows beyond all limits, and keep away from it"
    )
    return _at(dae, t, words)


def left_table(dae: Translated, t: float, table: Range) -> SolveError:
    """The argument of a table leaves it at time t."""
    return _at(dae, t, table.left)


def no_side(dae: Translated, t: float, conditions: Sequence[str]) -> SolveError:
    """Error: no side of some switches is consistent with the motion after it at time t."""
    words = (
        f"no side of {' and '.join(conditions)} agrees with what follows from it: the equations have no solution there, or "
        f"the motion would slide along the switch. {SMOOTH} change what jumps; friction that sticks is stick_slip"
    )
    return _at(dae, t, words)


def infinite(dae: Translated, t: float, conditions: Sequence[str], error: Infinite) -> SolveError:
    """Error: a switch at time t would take more than an impulse."""
    jumping, beyond = ", ".join(error.jumping[:4]), ", ".join(error.infinite[:4])
    law = (
        f"jump by impulses that stand in {beyond}, a law that is not linear in them. Make the law linear, or smooth what "
        "turns, as tanh(x / small) for sign(x)"
    )
    place = (
        f"jump at once, for which {beyond} would be infinite, more than an impulse. Expected positions that go on, whose "
        "speeds may jump: let the prescribed quantity rise within a time, as by a ramp, or put a spring or damper between"
    )
    words = f"{' and '.join(conditions)} turns, and {jumping} would {law if error.law else place}"
    return _at(dae, t, words, error.infinite if error.law else [])


def undetermined_jump(dae: Translated, t: float, conditions: Sequence[str]) -> SolveError:
    """Error: the equations after a switch at time t do not determine the jumps."""
    words = (
        f"{' and '.join(conditions)} turns, and the equations behind it do not determine what jumps, expected a mass or an "
        "inertia for every motion on both sides"
    )
    return _at(dae, t, words)


def endless_rounds(dae: Translated, t: float, labels: Sequence[str]) -> SolveError:
    """Whens act at one instant without end."""
    words = (
        f"{' and '.join(labels)} {'becomes' if len(labels) == 1 else 'become'} true again and again at one instant: what is "
        "done there makes the condition false and true anew. Let what acts lead to a side that stays"
    )
    return _at(dae, t, words, labels)


def accumulating(dae: Translated, t: float, label: str) -> SolveError:
    """A when acts in ever shorter intervals."""
    words = (
        f"{label} becomes true again and again, in intervals so short that rounding decides what is next: its instants "
        "accumulate there (Zeno). Let the motion end in a rest, as by a Discrete that a when sets where the speed is "
        "small, or end it with terminate(...)"
    )
    return _at(dae, t, words, [label])


def set_badly(dae: Translated, t: float, name: str, labels: Sequence[str]) -> SolveError:
    """Error: a value set by a when at time t is not finite."""
    words = f"at t = {t:.6g} s the new value of {dae.spoken(name)} is not finite; {NOT_FINITE}"
    return _stop(dae, t, f"{' and '.join(labels)}: {words}", labels)


def inconsistent(dae: Translated, t: float, labels: Sequence[str], error: SolveError) -> SolveError:
    """Error: values set by a when at time t contradict the constraints."""
    words = (
        f"at t = {t:.6g} s there is no motion with the new values of its states: {error}; {KEPT}: set other states, or "
        "values that the mechanism can reach"
    )
    return _stop(dae, t, f"{' and '.join(labels)}: {words}", labels)


def undecided(dae: Translated, t: float, one: When) -> SolveError:
    """Error at time t with the failure text of a when."""
    return _at(dae, t, one.failure, [one.label])
