"""FMUs: how fast they step, how long they take to be made, and how large they are."""

import math
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from gantrytau import translate
from gantrytau_fmu import export_fmu
from gantrytau_fmu.building.platforms import native
from gantrytau_models import GantryTau, SixLinkGantryTau, prototypes
from tests.benchmarks.engine import FORCES
from tests.benchmarks.table import Row, at_least, at_most, in_turn, print_table, shown

STEP, SECOND = 0.004, 250  # s of a communication step; steps after which the motion starts anew
AMPLITUDE = 60.0  # N
OUTPUTS = [f"tool.{letter}[{k}]" for letter in "rv" for k in range(3)]
STEPS = 1_000_000  # of the master in C
TOLERANCE = 1e-6
ROUNDS = 9
CONTROLLED, FIXED = "scipy's RK45 at the same tolerance", "one fixed RK4 step"
PYTHON_SLAVE = Path(__file__).with_name("python_slave.py")
C_MASTER = Path(__file__).parents[1] / "fmu" / "c_master.c"


def rows() -> Iterator[Row]:
    """All figures of FMUs."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        yield from _exports(folder)
        yield from _from_c(folder)
        yield from _beside_python(folder)


def forces() -> np.ndarray:
    """Forces that change at every step, (250, 3) in N: sines of 1, 2 and 3 Hz with 60 N."""
    return AMPLITUDE * np.sin(2 * math.pi * STEP * np.outer(np.arange(SECOND), [1, 2, 3]))


def _exports(folder: Path) -> Iterator[Row]:
    for title, model, limit in (
        ("three-link robot", lambda: GantryTau(prototypes.GT_A), 2.0),
        ("six-link robot", lambda: SixLinkGantryTau(prototypes.D1), 15.0),
    ):
        path = folder / f"{title.split('-')[0]}.fmu"
        times = in_turn({"export": lambda m=model, p=path: export_fmu(m(), p)}, 3 if limit < 5 else 1)
        yield at_most(
            f"FMU of the {title}, export with translation and compilation", times["export"], limit, "s"
        )
        size = path.stat().st_size / 1000
        if limit < 5:
            yield at_most(f"FMU of the {title}, one platform", size, 230.0, "kB")
        else:
            yield shown(f"FMU of the {title}, one platform", f"{size:.4g} kB")


def _from_c(folder: Path) -> Iterator[Row]:
    """Steps of a master written in C, FMI 3.0."""
    import fmpy

    figure = "FMU from C: set 3, step 4 ms, get 6, million steps in a second"
    compiler = shutil.which("cc")
    if compiler is None or sys.platform == "win32":
        yield shown(figure, "no C compiler, or no POSIX system")
        return
    unpacked = fmpy.extract(str(folder / "three.fmu"), str(folder / "three"))
    description = fmpy.read_model_description(unpacked)
    places = {variable.name: variable.valueReference for variable in description.modelVariables}
    library = next((Path(unpacked) / "binaries" / native().name).iterdir())
    master = folder / "c_master"
    subprocess.run([compiler, "-std=c99", "-O2", str(C_MASTER), "-o", str(master), "-ldl", "-lm"], check=True)
    names = [",".join(str(places[name]) for name in group) for group in (FORCES, OUTPUTS)]
    command = [str(master), str(library), description.instantiationToken, str(STEPS), str(AMPLITUDE), *names]
    times = []
    for _ in range(5):
        seconds, *values = (float(word) for word in subprocess.check_output(command, text=True).split())
        assert np.all(np.isfinite(values))
        times.append(seconds)
    yield at_least(figure, round(1e-6 * STEPS / float(np.median(times)), 3), 1.0)


def _beside_python(folder: Path) -> Iterator[Row]:
    """Through FMPy, FMI 2.0, beside the same equations in PythonFMU."""
    ours = export_fmu(GantryTau(prototypes.GT_A), folder / "three_2.fmu", fmi="2.0", tolerance=TOLERANCE)
    running = {"": Running(ours, FORCES, OUTPUTS)}
    start = running[""].values()
    with suppress(ImportError):  # PythonFMU is in the extra 'bench'
        for title, tolerance in ((FIXED, 0.0), (CONTROLLED, TOLERANCE)):
            path = python_fmu(folder, start, tolerance)
            running[title] = Running(path, [f"f{k}" for k in range(3)], [f"x{k}" for k in range(6)])
    times: dict[str, list[float]] = {title: [] for title in running}
    ends = {}
    for _ in range(ROUNDS):
        for title, slave in running.items():
            times[title].append(slave.second())
            ends[title] = slave.values()
    median = {title: float(np.median(found)) for title, found in times.items()}
    yield shown("FMU through FMPy: set 3, step 4 ms, get 6", f"{1e6 * median['']:.3g} us")
    for title in list(running)[1:]:
        apart = max(abs(a - b) for a, b in zip(ends[""][:3], ends[title][:3], strict=True))
        assert apart < 1e-5  # m after a second: they are the same robot
        ratio, figure = median[title] / median[""], f"the same, times faster than PythonFMU, {title}"
        if title == CONTROLLED:
            yield at_least(figure, round(ratio, 1), 20)
            yield shown("the positions of the two after 1 s, apart", f"{1e9 * apart:.2g} nm")
        else:
            yield shown(figure, f"{ratio:.3g}")
    if len(running) == 1:
        yield shown("the same, times faster than PythonFMU", "not installed")
    for slave in running.values():
        slave.close()


class Running:
    """An FMI 2.0 slave in FMPy, in its initial state after `initialize`."""

    def __init__(self, path: Path, inputs: list[str], outputs: list[str]):
        import fmpy
        from fmpy.fmi2 import FMU2Slave

        description: Any = fmpy.read_model_description(str(path), validate=False)
        places = {variable.name: variable.valueReference for variable in description.modelVariables}
        self.inputs, self.outputs = [places[name] for name in inputs], [places[name] for name in outputs]
        self.fmu: Any = FMU2Slave(
            guid=description.guid,
            unzipDirectory=fmpy.extract(str(path), str(path.with_suffix(""))),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="robot",
        )
        self.fmu.instantiate()
        self.initialize()

    def initialize(self) -> None:
        """Bring a new instance, or one that was reset, to its start."""
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def values(self) -> list[float]:
        """The outputs."""
        return self.fmu.getReal(self.outputs)

    def second(self) -> float:
        """The wall time of a step in s, over one second from the start, as FMPy's users set, step and get."""
        fmu, inputs, outputs = self.fmu, self.inputs, self.outputs
        fmu.reset()
        self.initialize()
        rows = forces().tolist()
        begin = time.perf_counter()
        for k, row in enumerate(rows):
            fmu.setReal(inputs, row)
            fmu.doStep(k * STEP, STEP)
            fmu.getReal(outputs)
        return (time.perf_counter() - begin) / len(rows)

    def close(self) -> None:
        """Release the library."""
        self.fmu.terminate()
        self.fmu.freeInstance()


def python_fmu(folder: Path, start: list[float], tolerance: float) -> Path:
    """The robot packed by PythonFMU; see `python_slave`. Raises ImportError where that is not installed."""
    from pythonfmu.builder import FmuBuilder  # pyright: ignore[reportMissingImports]

    found = translate(GantryTau(prototypes.GT_A)).function(["tool.r", "tool.v", *FORCES], ["der(tool.v)"])
    x, f, h = ca.MX.sym("x", 6), ca.MX.sym("f", 3), ca.MX.sym("h")
    rates = ca.Function("rates", [x, f], [ca.vertcat(x[3:], found(x[:3], x[3:], f[0], f[1], f[2]))])
    k1 = rates(x, f)
    k2 = rates(x + h / 2 * k1, f)
    k3 = rates(x + h / 2 * k2, f)
    k4 = rates(x + h * k3, f)
    step = ca.Function("step", [x, f, h], [x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)], {"cse": True})
    files = [folder / name for name in ("rates.casadi", "step.casadi", "robot.npz")]
    rates.save(str(files[0]))
    step.save(str(files[1]))
    np.savez(files[2], start=start, tolerance=tolerance)
    path = folder / f"python_{tolerance:g}.fmu"
    FmuBuilder.build_FMU(PYTHON_SLAVE, path, project_files=files)
    return path


if __name__ == "__main__":
    sys.exit(print_table("FMUs", [rows()]))
