"""FMUs that many tests look at, each exported once, beside the Dae that it was made of."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal
from zipfile import ZipFile

import casadi as ca
import numpy as np

from gantrytau import Dae, Model, translate
from gantrytau.mechanics.filters import LowPass
from gantrytau.mechanics.translational import StickSlipFriction
from gantrytau_fmu import export_fmu
from gantrytau_models import FourBar, GantryTau, Pendulum, SixLinkGantryTau, prototypes
from tests.fmu.runtime.raw_calls import OK, Instance, Kind, Library
from tests.simulation.sampled_models import Held

MODELS: dict[str, Any] = {
    "three-link": lambda: GantryTau(prototypes.L1),
    "six-link": lambda: SixLinkGantryTau(prototypes.L1),
    "four-bar": FourBar,
    "pendulum": Pendulum,
    "filter": lambda: LowPass(order=3, u=dict(start=0.5)),
    "sampled": Held,
    "stick-slip": lambda: GantryTau(prototypes.L1, friction=StickSlipFriction),
}


@dataclass(frozen=True, eq=False)
class Exported:
    """An FMU: its file, its library, its variables by name, and the model."""

    path: Path
    dae: Dae
    version: Literal[2, 3]

    @cached_property
    def described(self) -> Any:
        from fmpy import read_model_description

        return read_model_description(self.path)

    @cached_property
    def references(self) -> dict[str, int]:
        return {v.name: v.valueReference for v in self.described.modelVariables}

    @cached_property
    def folder(self) -> Path:
        """Unpacked."""
        target = self.path.with_suffix("")
        with ZipFile(self.path) as archive:
            archive.extractall(target)
        return target

    @cached_property
    def library(self) -> Library:
        token = self.described.guid if self.version == 2 else self.described.instantiationToken
        (binary,) = (p for p in (self.folder / "binaries").rglob("*") if p.is_file())
        return Library(binary, self.version, token)

    def new(self, kind: Kind = "CoSimulation") -> "Running":
        made = self.library.instantiate(kind)
        assert made
        return Running(self, made)


@dataclass(eq=False)
class Running:
    """An instance whose variables are read and written by name; every call must succeed."""

    fmu: Exported
    instance: Instance
    time: float = field(default=0.0)

    def __enter__(self) -> "Running":
        return self

    def __exit__(self, *_: object) -> None:
        self.instance.free()

    def _numbers(self, names: Sequence[str]) -> list[int]:
        return [self.fmu.references[n] for n in names]

    def __getitem__(self, names: Any) -> Any:
        several = [names] if isinstance(names, str) else list(names)
        status, values = self.instance.get(*self._numbers(several))
        assert status == OK, self.instance.message
        return values[0] if isinstance(names, str) else np.array(values)

    def __setitem__(self, name: str, value: float) -> None:
        status = self.instance.set(self.fmu.references[name], float(value))
        assert status == OK, self.instance.message

    def enter(self, **experiment: Any) -> "Running":
        assert self.instance.enter(**experiment) == OK, self.instance.message
        self.time = experiment.get("start", 0.0)
        return self

    def begin(self, **values: float) -> "Running":
        """Up to step mode or event mode, with values set in between."""
        self.enter()
        for name, value in values.items():
            self[name] = value
        return self.exit()

    def exit(self) -> "Running":
        assert self.instance("ExitInitializationMode") == OK, self.instance.message
        return self

    def settle(self) -> None:
        """From event mode to continuous-time mode."""
        assert self.instance.update() == OK
        assert self.instance.update() == OK  # what was sampled in the first iteration asks for a second
        assert self.instance("EnterContinuousTimeMode") == OK, self.instance.message

    def step(self, size: float) -> None:
        assert self.instance.step(self.time, size) == OK, self.instance.message
        self.time += size


def export(model: Model | Dae, path: Path, version: Literal[2, 3] = 3, **options: Any) -> Exported:
    """Export a model, whose file name is `path`."""
    keep = {k: options.pop(k) for k in ("given", "states") if k in options}
    dae = model if isinstance(model, Dae) else translate(model, events=True, **keep)
    export_fmu(dae, path, fmi="2.0" if version == 2 else "3.0", **options)
    return Exported(path, dae, version)


class Numbers:
    """Rates and outputs of a Dae and their exact Jacobians by CasADi; implicit unknowns by Newton's method.

    Values are (t, x, u, p); what an FMU computes is compared with these.
    """

    def __init__(self, dae: Dae, outputs: Sequence[str] = ()):
        system = dae.system()
        self.dae, self.z = dae, np.array([dae.start[a.name] for a in system.algebraics])
        self.x = np.array([dae.start[n] for n in dae.choice.states])
        self.u = np.array([dae.start.get(n, 0.0) for n in system.inputs])
        self.p = np.array([dae.table.values[n] for n in system.parameters])
        wanted = system.to_system([dae.expression(n) for n in outputs]) if outputs else []
        found = ca.densify(ca.vertcat(system.ode, *wanted))
        arguments = [system.time, system.x, system.u, system.p, system.z]
        self.found = ca.Function("found", arguments, [found])
        self.residuals = ca.Function("residuals", arguments, [ca.densify(system.residuals)])
        slopes = [[ca.densify(ca.jacobian(e, a)) for a in arguments] for e in (found, system.residuals)]
        self.slopes = [ca.Function("slopes", arguments, row) for row in slopes]

    def solved(self, t: float, x: Any, u: Any, p: Any) -> list[Any]:
        """The arguments with z, solved to rounding from the z found last."""
        if not self.z.size:
            return [t, x, u, p, self.z]
        for _ in range(30):
            slope = np.array(self.slopes[1](t, x, u, p, self.z)[4])
            step = np.linalg.solve(slope, np.array(self.residuals(t, x, u, p, self.z)).ravel())
            self.z = self.z - step
            if np.max(np.abs(step) / (1 + np.abs(self.z))) < 1e-14:
                break
        return [t, x, u, p, self.z]

    def __call__(self, t: float, x: Any, u: Any = None, p: Any = None) -> np.ndarray:
        """Rates, then outputs."""
        arguments = self.solved(t, x, self.u if u is None else u, self.p if p is None else p)
        return np.array(self.found(*arguments)).ravel()

    def jacobian(self, t: float, x: Any, u: Any = None, p: Any = None) -> np.ndarray:
        """Of rates and outputs by (t, x, u, p), through z by the implicit function theorem."""
        arguments = self.solved(t, x, self.u if u is None else u, self.p if p is None else p)
        *direct, by_z = (np.array(e) for e in self.slopes[0](*arguments))
        whole = np.hstack(direct)
        if not self.z.size:
            return whole
        *given, own = (np.array(e) for e in self.slopes[1](*arguments))
        return whole - by_z @ np.linalg.solve(own, np.hstack(given))

    def integrate(self, times: Any, x: Any = None, u: Any = None) -> np.ndarray:
        """States at times, (n, states), with DOP853; u: input values, (inputs,), or a function of time."""
        from scipy.integrate import solve_ivp

        at = u if callable(u) else lambda _: u
        count = len(self.x)
        found = solve_ivp(
            lambda t, y: self(t, y, at(t))[:count],
            (times[0], times[-1]),
            self.x if x is None else x,
            "DOP853",
            times,
            rtol=1e-12,
            atol=1e-14,
        )
        assert found.success
        return found.y.T

    def cvodes(self, size: float) -> Any:
        """x, u -> x after a step of that size in s, by CVODES at 1e-12; without implicit unknowns and time."""
        x, u = ca.SX.sym("x", len(self.x)), ca.SX.sym("u", len(self.u))
        rates = self.found(0.0, x, u, self.p, [])[: len(self.x)]
        options = dict(reltol=1e-12, abstol=1e-14, max_num_steps=1_000_000)
        step = ca.integrator("step", "cvodes", dict(x=x, p=u, ode=rates), 0.0, size, options)
        return lambda at, inputs: np.array(step(x0=at, p=inputs)["xf"]).ravel()
