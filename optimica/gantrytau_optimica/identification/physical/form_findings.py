"""What speaks against masses, damping and stiffness that were found."""

from collections.abc import Iterator

import numpy as np

from gantrytau.answers.linear_systems.linear_system import LinearSystem
from gantrytau_optimica.fitting.finding import Finding
from gantrytau_optimica.identification.physical.mechanical_form import MechanicalForm
from gantrytau_optimica.identification.physical.output_coordinates import POSITION, speed_jump

APART = 0.2  # of M and of K by norm, by which two routes may differ
MISSED = 0.1  # of the response by norm, that M, D and K may leave
SKEW = 0.1  # |X - X'| / |X + X'| of M and K
ALIASED = 0.8  # of half of the sampling frequency, above which a mode may be that of another
WORDS = {"M": "mass", "D": "damping", "K": "stiffness"}
NONE = np.zeros(0, dtype=int)


def form_findings(
    form: MechanicalForm,
    direct: MechanicalForm,
    missed: float,
    system: LinearSystem,
    continuous: LinearSystem,
) -> tuple[Finding, ...]:
    """Kinds "modes", "indefinite", "not symmetric", "disagreement", "fit", "aliased"."""
    told = (
        *_modes(continuous),
        *_indefinite(form, direct),
        *_apart(form, direct),
        *_unexplained(missed),
        *_aliased(system, continuous),
    )
    return tuple(Finding(kind, NONE, words) for kind, words in told)


def _modes(continuous: LinearSystem) -> Iterator[tuple[str, str]]:
    if speed_jump(continuous) > POSITION:
        order = len(continuous.A)
        yield (
            "modes",
            f"a model of order {order} whose positions jump in speed with a force (|C B| w / |C A B| = "
            f"{speed_jump(continuous):.2g}) stands for more modes than {order // 2}: the direct route is far off; identify "
            "a higher order with a position for each mode, or hold only the fit for true, up to its modes",
        )


def _indefinite(form: MechanicalForm, direct: MechanicalForm) -> Iterator[tuple[str, str]]:
    routes = {"the direct route": direct} if form is direct else {"the direct route": direct, "the fit": form}
    for route, found in routes.items():
        for name in found.indefinite:
            x = getattr(found, name)
            least = np.linalg.eigvalsh((x + x.T) / 2)[0]
            yield (
                "indefinite",
                f"{WORDS[name]} {name} of {route} is not positive definite (least eigenvalue of its symmetric part "
                f"{least:.4g}): no structure of these coordinates alone; it has more modes, inputs are no forces along the "
                "outputs, or the model is too inaccurate",
            )
    for name in ("M", "K"):
        skew = direct.asymmetry[name]
        if skew > SKEW:
            yield (
                "not symmetric",
                f"{WORDS[name]} {name} of the direct route is not symmetric ({skew:.0%}): forces and positions do not "
                "belong to each other, or the model is too inaccurate",
            )


def _apart(form: MechanicalForm, direct: MechanicalForm) -> Iterator[tuple[str, str]]:
    pairs = {name: (getattr(form, name), getattr(direct, name)) for name in ("M", "K")}
    changes = {name: float(np.linalg.norm(a - b) / np.linalg.norm(a)) for name, (a, b) in pairs.items()}
    if max(changes.values()) > APART:
        words = " and ".join(f"{name} by {change:.0%}" for name, change in changes.items())
        told = (
            f"the direct route differs from the fit in {words}: neither is sure; look at `plot_bode` of both"
        )
        yield "disagreement", f"{told}, and identify a model from more data"


def _unexplained(missed: float) -> Iterator[tuple[str, str]]:
    if missed > MISSED:
        words = f"M, D and K leave {missed:.0%} of the motion, besides noise, expected {MISSED:.0%} at most: more modes, or "
        yield "fit", f"{words}inputs are no forces along the outputs; give a position for each mode"


def _aliased(system: LinearSystem, continuous: LinearSystem) -> Iterator[tuple[str, str]]:
    if system.period is None:
        return
    fastest, half = float(np.abs(np.imag(continuous.poles)).max() / (2 * np.pi)), 0.5 / system.period
    if fastest > ALIASED * half:
        words = f"a mode of {fastest:.3g} Hz is near to half of the sampling frequency, {half:.3g} Hz"
        yield "aliased", f"{words}, beyond which modes fold back; sample more often"
