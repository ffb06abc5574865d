"""Trials of an installation: each computes a number that is known, in a folder for its files, or raises."""

import warnings
from pathlib import Path

from gantrytau import Input, Real, der, simulate
from gantrytau_models import Pendulum


class CompilerMissing(Exception):
    """There is no C compiler."""


def expect(what: str, found: float, expected: float, tolerance: float) -> None:
    """ArithmeticError unless a number is as expected."""
    if not abs(found - expected) <= tolerance:
        raise ArithmeticError(f"{what} is {found:.9g}, expected {expected:.9g}")


def simulated(folder: Path) -> str:
    """A pendulum without damping keeps its length and its energy; it is drawn and saved."""
    found = simulate(Pendulum(damping=0.0, L=1.0), stop=1.0)
    energy = 9.81 * found["y"] + (found["v_x"] ** 2 + found["v_y"] ** 2) / 2  # J/kg
    expect("the energy", float(energy[-1] - energy[0]), 0.0, 1e-5)
    found.plot("x", file=folder / "x.png")
    found.save(folder / "x.csv")
    return "simulated and drew a pendulum"


def optimized(folder: Path) -> str:
    """The least square of speed over one metre in one second is 1 m2/s, at constant speed."""
    from gantrytau_optimica import Optimization, final, optimize

    class Straight(Optimization):
        x = Real(unit="m", start=0.0, fixed=True)
        u = Input(unit="m/s")
        final_time = 1.0

        def equations(self):
            yield der(self.x) == self.u

        def integrand(self):
            return self.u**2

        def constraints(self):
            yield final(self.x) == 1.0

    expect("the least square of speed", optimize(Straight, elements=5).objective, 1.0, 1e-6)
    return "solved a problem"


def exported(folder: Path) -> str:
    """The FMU of a pendulum swings as the model does; CompilerMissing where it cannot be compiled."""
    from gantrytau_fmu import export_fmu, run_fmu

    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        file = export_fmu(Pendulum(), folder / "pendulum.fmu")
    if any("compiler" in str(warning.message) for warning in told):
        raise CompilerMissing("there is no C compiler")
    model, run = simulate(Pendulum(), stop=0.1, points=3), run_fmu(file, stop=0.1, step=0.001)
    expect("x(0.1 s)", run.final("x"), model.final("x"), 1e-4)
    return "exported a pendulum, which swings as its model does"
