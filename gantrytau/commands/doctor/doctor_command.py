"""`gantrytau doctor`: whether an installation works: Python, packages, a simulation, an optimum, an FMU, extras."""

import importlib.metadata
import platform
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from dataclasses import asdict, dataclass
from io import StringIO
from pathlib import Path

import typer
from packaging.requirements import Requirement

from gantrytau.commands.arguments.options import Json
from gantrytau.commands.doctor import trials
from gantrytau.commands.printing.reporting import FAULT, as_json, busy, print_table

LEAST_PYTHON = (3, 11)
OK, BROKEN, MISSING = "ok", "broken", "not installed"
AGAIN = "reinstall what it needs: pip install --force-reinstall"
TRIALS = (  # name, the function that tries it, whether nothing goes without, what to do
    ("simulate", trials.simulated, True, f"{AGAIN} casadi matplotlib"),
    ("optimize", trials.optimized, True, f"{AGAIN} casadi"),
    ("fmu", trials.exported, False, "install gcc or clang (apt install gcc libc6-dev), or the extra 'cross'"),
)
EXTRAS = ("results", "view", "cross", "vision", "cluster")


@dataclass(frozen=True)
class Checked:
    """One line of the examination: the probe, its result, and a remedy if it failed.

    state: "ok", "broken" (it is there and does not work) or "not installed"; seconds: that the trial took.
    """

    group: str
    name: str
    found: str
    state: str = OK
    essential: bool = True
    remedy: str = ""
    seconds: float = 0.0

    @property
    def harmful(self) -> bool:
        """Whether the probe found a fault: something broken, or something essential missing."""
        return self.state == BROKEN or (self.essential and self.state != OK)


def doctor(json: Json = False) -> None:
    """Check that this installation works: packages, a simulation, an optimum, an FMU, extras.

    Each is tried in small, not only looked for; exit code 1 if something is broken, or missing and needed.
    """
    with busy("trying what is installed"):
        findings = list(examine())
    ok = not any(finding.harmful for finding in findings)
    if json:
        typer.echo(as_json({"ok": ok, "findings": [asdict(finding) for finding in findings]}))
    else:
        rows = [(f.group, f.name, f.found, f.state, f"{f.seconds:.1f}") for f in findings]
        print_table(("", "what", "found", "", "s"), rows, right=(4,))
        for f in findings:
            if f.state != OK:
                typer.echo(f"{f.state if f.harmful else 'optional'}: {f.name}: {f.remedy}")
        typer.echo("What is installed works." if ok else "This installation does not work.")
    if not ok:
        raise typer.Exit(FAULT)


def examine() -> Iterator[Checked]:
    """Try all that the toolkit needs or can use, one after the other; nothing is changed."""
    found = f"{platform.python_version()} on {platform.system()} {platform.machine()}"
    least = ".".join(map(str, LEAST_PYTHON))
    state = OK if sys.version_info >= LEAST_PYTHON else BROKEN
    yield Checked("python", "python", found, state, remedy=f"install Python {least} or newer")
    yield package("packages", Requirement("gantrytau"))
    required = [Requirement(text) for text in importlib.metadata.requires("gantrytau") or ()]
    for one in required:
        if one.marker is None or one.marker.evaluate({"extra": ""}):
            yield package("packages", one)
    for name, trial, essential, remedy in TRIALS:
        yield tried(name, trial, essential, remedy)
    for extra in EXTRAS:
        for one in required:
            if one.marker is not None and one.marker.evaluate({"extra": extra}):
                yield package(extra, one, f"pip install 'gantrytau[{extra}]'")


def package(group: str, wanted: Requirement, extra: str = "") -> Checked:
    """Whether a package is installed and new enough; extra: the command that installs an optional package."""
    try:
        found = importlib.metadata.version(wanted.name)
    except importlib.metadata.PackageNotFoundError:
        remedy = extra or f"pip install '{wanted.name}{wanted.specifier}'"
        return Checked(group, wanted.name, MISSING, MISSING, not extra, remedy)
    if wanted.specifier.contains(found, prereleases=True):
        return Checked(group, wanted.name, found, essential=not extra)
    remedy = f"pip install '{wanted.name}{wanted.specifier}'"
    return Checked(group, wanted.name, f"{found}, expected {wanted.specifier}", BROKEN, not extra, remedy)


def tried(name: str, trial: Callable[[Path], str], essential: bool, remedy: str) -> Checked:
    """What a trial says, its time, and whatever it raises as words; what it prints is dropped."""
    begin = time.perf_counter()
    try:
        with (
            tempfile.TemporaryDirectory(prefix="gantrytau-") as folder,
            redirect_stdout(StringIO()),
            warnings.catch_warnings(),
        ):
            warnings.simplefilter("ignore")
            found, state = trial(Path(folder)), OK
    except trials.CompilerMissing as error:
        found, state = str(error), MISSING
    except (Exception, SystemExit) as error:  # whatever a package that is broken raises
        lines = str(error).strip().splitlines()
        found, state = f"{type(error).__name__}: {lines[0] if lines else 'without words'}", BROKEN
    return Checked("trials", name, found, state, essential, remedy, round(time.perf_counter() - begin, 3))
