"""Optimal control problems of the literature, cold and with all defaults, against converged objectives and rockit."""

import time
from dataclasses import dataclass
from typing import Any

from gantrytau import GantryTauError
from gantrytau_optimica import optimize
from tests.classics.lines import lines_of
from tests.classics.row import Row
from tests.classics.with_rockit import solved
from tests.optimica.known_answers.test_literature import PROBLEMS as CONVERGED

WANTED = 1e-4  # of the objective
COPS, DYMOS, PSOPT = "COPS 3", "dymos", "PSOPT"
SOURCES = {  # problem -> source, and the objective printed there where it is known
    "SwingUp": (f"{DYMOS}, cart-pole", "58.88395 (its force ends at 0)"),
    "BrysonDenham": ("Bryson and Ho (1975)", "4"),
    "Hull": ("Hull (2003)", ""),
    "LinearHypersensitive": (DYMOS, "1.673093978"),
    "Breakwell": ("Breakwell (1959)", "4.444444"),
    "Brachistochrone": (DYMOS, "1.8016"),
    "CubicHypersensitive": (f"Rao and Mease (2000), {PSOPT}", "1.330826"),
    "RestToRest": ("bang-bang in closed form", "20"),
    "MoonLander": (DYMOS, "-0.3953"),
    "MountainCar": (f"{DYMOS}, Melnikov (2014)", ""),
    "Reorientation": (f"Fleming (2010), {PSOPT}", ""),
    "CatalystMixing": (f"{COPS}, problem 14", "-0.0480556"),
    "Goddard": (f"{COPS}, problem 10", "-1.01283"),
    "ParticleSteering": (f"{COPS}, problem 9", "0.554577"),
    "RobotArm": (f"{COPS}, problem 8", "9.14093"),
    "HangGlider": ("Betts (2010)", "-1248.031"),
    "HangingChain": (f"{COPS}, problem 4", "5.06848"),
    "MaximumRange": (f"Bryson and Ho (1975), {PSOPT}", ""),
    "MixedRayleigh": ("Maurer and Augustin (2001)", "44.8044"),
    "Isoperimetric": (f"Betts (2010), {PSOPT}", ""),
    "InteriorPoint": (f"Miele (1975), {PSOPT}", ""),
    "CraneSwing": (f"Sakawa and Shindo (1982), {PSOPT}", ""),
    "Singular": (f"Luus (2002), {PSOPT}", ""),
    "TwoLinkArm": (f"Luus (2000), {PSOPT}", "2.9887"),
    "TwoMasses": (f"Driessen and Sadegh (2004), {PSOPT}", "2.1050"),
    "Missile": (f"Subchan and Zbikowski (2009), {PSOPT}", ""),
    "Reentry": (f"Betts (2010), {DYMOS}, {PSOPT}", "-34.1412"),
    "AirlessGoddard": (f"{PSOPT}, goddard", ""),
    "VanDerPol": (DYMOS, ""),
    "Ascent": (f"{DYMOS}, ssto_earth", ""),
    "Farthest": (DYMOS, "-0.25"),
    "JacobsonLele": ("Jacobson and Lele (1969)", "0.16982"),
    "Rayleigh": ("Betts (2010), rayl01", "29.376"),
    "BoundedOscillator": ("JModelica, Van der Pol", ""),
    "FastestOscillator": ("JModelica, Van der Pol", ""),
    "LimitedMass": ("bang-coast-bang in closed form", "2.5"),
    "LinearQuadratic": ("linear quadratic in closed form", ""),
}
NOTES = {
    "CubicHypersensitive": "50 elements of 1 s do not resolve its ends",
    "TwoMasses": "printed on a coarse mesh; its friction turns within 0.01 m/s",
    "TwoLinkArm": "printed on a coarse mesh",
    "InteriorPoint": "the point, at three quarters, lies inside of an element",
    "BoundedOscillator": "the input leaves its limit inside of an element",
}


@dataclass(frozen=True)
class ControlProblem:
    """A problem and its converged objective."""

    problem: Any
    converged: float

    @property
    def name(self) -> str:
        """That of its class."""
        return self.problem.__name__


PROBLEMS = tuple(ControlProblem(problem, value) for problem, value, *_ in CONVERGED)


def run(one: ControlProblem) -> Row:
    """The problem as it is declared, with all defaults."""
    source, printed = SOURCES[one.name]
    begin = time.process_time()
    row: Row = {
        "source": source,
        "lines": lines_of(one.problem),
        "converged": f"{one.converged:.8g}",
        "printed": printed,
    }
    try:
        found = optimize(one.problem)
    except GantryTauError as error:
        return {**row, "failure": str(error).splitlines()[0], "held": False}
    seconds = time.process_time() - begin
    error, note = abs(found.objective / one.converged - 1), NOTES.get(one.name, "")
    held = bool(found.success and error <= WANTED)
    if not held:
        note += f"; `refine=1e-6` gives {optimize(one.problem, refine=1e-6).objective:.8g}"
    return {
        **row,
        "objective": f"{found.objective:.8g}",
        "error": error,
        "iterations": found.iterations,
        "seconds": round(seconds, 3),
        "rockit": solved(one.name),
        "note": note,
        "held": held,
    }
