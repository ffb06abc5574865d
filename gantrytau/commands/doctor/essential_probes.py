"""Trials of what nothing goes without, and of the C compiler: each says what it did, or raises."""

import math
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

PATIENCE = 60.0  # s, for a compiler
QUIET = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False}
PROGRAM = 'int printf(const char *, ...); int main(void) { printf("%d\\n", 6 * 7); return 0; }\n'


class Missing(Exception):
    """What was to be tried is not there."""


class Wrong(Exception):
    """What was tried answered, but not as it should."""


def expect(what: str, found: float, expected: float, tolerance: float) -> None:
    """Wrong unless a number is as expected."""
    if not abs(found - expected) <= tolerance:
        raise Wrong(f"{what} is {found:.9g}, expected {expected:.9g}")


def _casadi(kind: str, name: str) -> Any:
    """CasADi, with a plug-in of it."""
    import casadi

    if not getattr(casadi, f"has_{kind}")(name):
        raise Missing(f"casadi lacks the plug-in {name}")
    return casadi


def ipopt() -> str:
    """The least of (x - 1)^2 + (y - 2)^2 on x + y = 1 is at (0, 1)."""
    ca = _casadi("nlpsol", "ipopt")
    _casadi("linsol", "mumps")
    x = ca.SX.sym("x", 2)
    problem = dict(x=x, f=(x[0] - 1) ** 2 + (x[1] - 2) ** 2, g=x[0] + x[1])
    solver = ca.nlpsol("tried", "ipopt", problem, {**QUIET, "ipopt.linear_solver": "mumps"})
    found = solver(x0=[5.0, 5.0], lbg=1.0, ubg=1.0)["x"]
    expect("the minimum found", float(found[0]), 0.0, 1e-6)
    expect("the minimum found", float(found[1]), 1.0, 1e-6)
    return "solved a problem (with mumps)"


def cvodes() -> str:
    """X' = -x falls to 1/e in 1 s."""
    ca = _casadi("integrator", "cvodes")
    x = ca.SX.sym("x")
    step = ca.integrator("tried", "cvodes", dict(x=x, ode=-x), 0.0, 1.0, dict(reltol=1e-9, abstol=1e-9))
    expect("x(1 s)", float(step(x0=1.0)["xf"]), math.exp(-1), 1e-6)
    return "integrated an equation"


def idas() -> str:
    """The same with an algebraic unknown, x' = z, 0 = z + x."""
    ca = _casadi("integrator", "idas")
    x, z = ca.SX.sym("x"), ca.SX.sym("z")
    dae = dict(x=x, z=z, ode=z, alg=z + x)
    step = ca.integrator("tried", "idas", dae, 0.0, 1.0, dict(reltol=1e-9, abstol=1e-9))
    expect("x(1 s)", float(step(x0=1.0, z0=-1.0)["xf"]), math.exp(-1), 1e-6)
    return "integrated an equation with a constraint"


def newton() -> str:
    """The root of x^2 = 2."""
    ca = _casadi("rootfinder", "newton")
    x = ca.SX.sym("x")
    root = ca.rootfinder("tried", "newton", dict(x=x, g=x**2 - 2))
    expect("the root of 2", float(root(x0=1.0)["x"]), 2**0.5, 1e-9)
    return "found a root"


def picture() -> str:
    """A line is drawn into a picture, without a display."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with tempfile.TemporaryDirectory(prefix="gantrytau-") as folder:
        figure = Figure(figsize=(2.0, 1.0))
        FigureCanvasAgg(figure)
        figure.subplots().plot([0.0, 1.0], [0.0, 1.0])
        file = Path(folder) / "line.png"
        figure.savefig(file)
        if not file.read_bytes().startswith(b"\x89PNG"):
            raise Wrong("what was written is no PNG")
    return "drew a picture (PNG)"


def square(x: float) -> float:
    """What other processes are asked for."""
    return x * x


def processes() -> str:
    """A process of its own answers."""
    from gantrytau import study

    found = study(square, over={"x": [2.0, 3.0]})
    expect("the square of 3", float(list(found.values)[1]), 9.0, 0.0)
    return f"called a function in other processes ({os.cpu_count()} processors)"


def compiler() -> str:
    """A program is compiled by the C compiler that `CC` names, else the first on the path, and run."""
    candidates = [name for name in (os.environ.get("CC"), "cc", "gcc", "clang", "cl") if name]
    path = next((found for name in candidates if (found := shutil.which(name))), None)
    if path is None:
        raise Missing("not found")
    with tempfile.TemporaryDirectory(prefix="gantrytau-") as folder:
        source, program = Path(folder) / "tried.c", Path(folder) / "tried.exe"
        source.write_text(PROGRAM)
        target = [f"/Fe:{program}"] if Path(path).stem.lower() == "cl" else ["-o", str(program)]
        _run([path, str(source), *target], folder, f"{path} (named by CC, or the first on the PATH)")
        if _run([str(program)], folder, "the program it made").strip() != "42":
            raise Wrong(f"{path}: the program it made counts wrongly")
    return f"{path}: compiled a program, which ran"


def _run(command: list[str], folder: str, what: str) -> str:
    try:
        found = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, timeout=PATIENCE, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise Wrong(f"{what}: {error}") from error
    if found.returncode:
        said = (found.stderr or found.stdout).strip().splitlines()
        raise Wrong(f"{what} fails: {said[0] if said else f'exit code {found.returncode}'}")
    return found.stdout


def fmu() -> str:
    """A model is exported, and its FMU swings as the model does."""
    from gantrytau import simulate
    from gantrytau_fmu import export_fmu, run_fmu
    from gantrytau_models import Pendulum

    with tempfile.TemporaryDirectory(prefix="gantrytau-") as folder:
        with_binary = _exported(export_fmu, Pendulum(), Path(folder) / "pendulum.fmu")
        model = simulate(Pendulum(), stop=0.1, points=3)
        run = run_fmu(with_binary, stop=0.1, step=0.001)
        expect("x(0.1 s)", run.final("x"), model.final("x"), 1e-4)
    return "exported a pendulum, which swings as its model does"


def _exported(export: Any, model: Any, file: Path) -> Path:
    """An FMU that this machine runs; Missing where there is no compiler, which is a warning."""
    import warnings

    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        found = export(model, file)
    for warning in told:
        if "compiler" in str(warning.message):
            raise Missing("there is no C compiler")
    return found
