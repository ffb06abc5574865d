"""What `gantrytau doctor` finds out about an installation: what is there, and whether it works."""

import importlib.metadata
import json
import platform
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from dataclasses import asdict, dataclass

from packaging.requirements import Requirement

from gantrytau.commands.doctor import essential_probes, extra_probes
from gantrytau.commands.doctor.essential_probes import Missing

_LEAST_PYTHON = (3, 11)
OK, BROKEN, MISSING = "ok", "broken", "not installed"
_COMPILER = (
    "needed to compile functions and FMUs; install gcc or clang (Debian, Ubuntu: apt install gcc libc6-dev)"
)
# group, what is tried, the function that tries it, whether nothing goes without, what to do
_ESSENTIAL = (
    ("solvers", "ipopt", essential_probes.ipopt, "optimize", "casadi"),
    ("solvers", "cvodes", essential_probes.cvodes, "simulate", "casadi"),
    ("solvers", "idas", essential_probes.idas, "simulate", "casadi"),
    ("solvers", "newton", essential_probes.newton, "consistent start values", "casadi"),
    ("pictures", "matplotlib", essential_probes.picture, "plots", "matplotlib"),
    ("processes", "loky", essential_probes.processes, "studies on all processors", "loky"),
)
_EXTRAS = (
    ("results", extra_probes.results),
    ("view", extra_probes.view),
    ("cross", extra_probes.cross),
    ("vision", extra_probes.vision),
    ("cluster", extra_probes.cluster),
)


@dataclass(frozen=True)
class Checked:
    """One line of the examination: what was tried, what was found, and what to do if it is not good.

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
    def good(self) -> bool:
        """Whether it works."""
        return self.state == OK

    @property
    def harmful(self) -> bool:
        """Whether the installation is not as it should be: what is broken, and what is missing and essential."""
        return self.state == BROKEN or (self.essential and not self.good)


def examine() -> Iterator[Checked]:
    """Try all that the toolkit needs or can use, one after the other; nothing is changed."""
    yield _python()
    yield from _packages()
    for group, name, probe, purpose, package in _ESSENTIAL:
        remedy = f"{purpose} needs it; reinstall it: pip install --force-reinstall {package}"
        yield tried(group, name, probe, remedy)
    yield tried("compiler", "C compiler", essential_probes.compiler, _COMPILER, essential=False)
    fmu = (
        "FMUs are compiled and run; see what is said of the C compiler, or pip install --force-reinstall fmpy"
    )
    yield tried("compiler", "FMU", essential_probes.fmu, fmu, essential=False)
    for extra, probe in _EXTRAS:
        yield _extra(extra, probe)


def tried(group: str, name: str, probe: Callable[[], str], remedy: str, *, essential: bool = True) -> Checked:
    """What a probe says, its time, and whatever it raises as words; what it prints is dropped."""
    begin = time.perf_counter()
    try:
        with warnings.catch_warnings(), redirect_stdout(_Nowhere()):
            warnings.simplefilter("ignore")
            found, state = probe(), OK
    except Missing as error:
        found, state = str(error), MISSING
    except (Exception, SystemExit) as error:  # whatever a package that is broken raises
        said = str(error).strip().splitlines()
        found, state = f"{type(error).__name__}: {said[0] if said else 'without words'}", BROKEN
    return Checked(group, name, found, state, essential, remedy, round(time.perf_counter() - begin, 3))


class _Nowhere:
    """A file to which everything may be written."""

    def write(self, text: str) -> int:
        return len(text)

    def flush(self) -> None:
        """There is nothing to be kept."""


def as_json(findings: list[Checked]) -> str:
    """The findings as a JSON object, with `ok` false if something is broken, or missing and essential."""
    ok = not any(finding.harmful for finding in findings)
    return json.dumps({"ok": ok, "findings": [asdict(finding) for finding in findings]}, indent=2)


def show(findings: list[Checked]) -> None:
    """Print the findings as a table, and below it what to do."""
    from rich import box
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    table = Table("", "what", "found", box=box.SIMPLE, title="gantrytau doctor", title_justify="left")
    table.add_column("s", justify="right")
    group = ""
    for finding in findings:
        if finding.group != group:
            group = finding.group
            table.add_row("", f"[bold]{group}[/bold]", "", "")
        colour = "green" if finding.good else "red" if finding.harmful else "dim"
        mark = "-" if finding.state == MISSING and not finding.essential else finding.state
        seconds = f"{finding.seconds:.1f}" if finding.seconds >= 0.05 else ""
        table.add_row(f"[{colour}]{mark}[/{colour}]", escape(finding.name), escape(finding.found), seconds)
    console = Console()
    console.print(table)
    for finding in findings:
        if not finding.good:
            weight = "broken" if finding.state == BROKEN else "missing" if finding.essential else "optional"
            colour = "red" if finding.harmful else "bold"
            words = escape(f"{finding.name}: {finding.remedy}")
            console.print(f"[{colour}]{weight}[/{colour}]: {words}", soft_wrap=True)
    if all(finding.good for finding in findings):
        console.print("Everything works.")
    elif not any(finding.harmful for finding in findings):
        console.print("What is installed works.")


def _python() -> Checked:
    least = ".".join(map(str, _LEAST_PYTHON))
    return Checked(
        "python",
        "python",
        f"{platform.python_version()} on {platform.system()} {platform.machine()}",
        OK if sys.version_info >= _LEAST_PYTHON else BROKEN,
        remedy=f"install Python {least} or newer",
    )


def _packages() -> Iterator[Checked]:
    """The toolkit itself, and what it requires, with versions."""
    version = _version("gantrytau")
    if version is None:
        yield Checked("packages", "gantrytau", MISSING, MISSING, remedy="pip install -e .")
        return
    yield Checked("packages", "gantrytau", version)
    for text in importlib.metadata.requires("gantrytau") or ():
        requirement = Requirement(text)
        if requirement.marker is None or requirement.marker.evaluate({"extra": ""}):
            yield _package(requirement)


def _package(requirement: Requirement) -> Checked:
    version = _version(requirement.name)
    good = version is not None and requirement.specifier.contains(version, prereleases=True)
    found = version or MISSING
    state = OK if good else MISSING if version is None else BROKEN
    expected = f"{found}, expected {requirement.specifier}" if not good else found
    return Checked("packages", requirement.name, expected, state, remedy=f"pip install '{requirement}'")


def _extra(extra: str, probe: Callable[[], str]) -> Checked:
    """Whether all packages of an extra are installed, and do what they are there for."""
    parts = [Requirement(text) for text in importlib.metadata.requires("gantrytau") or ()]
    names = [part.name for part in parts if part.marker and part.marker.evaluate({"extra": extra})]
    versions = {name: _version(name) for name in names}
    told = ", ".join(f"{name} {version or MISSING}" for name, version in versions.items())
    remedy = f"pip install 'gantrytau[{extra}]'"
    if None in versions.values():
        return Checked("extras", extra, told, MISSING, essential=False, remedy=remedy)
    again = f"pip install --force-reinstall {' '.join(names)}"
    return tried("extras", extra, lambda: f"{probe()}: {told}", again, essential=False)


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None
