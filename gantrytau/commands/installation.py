"""What `gantrytau doctor` finds out about an installation."""

import importlib.metadata
import json
import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass

from packaging.requirements import Requirement

_LEAST_PYTHON = (3, 11)
_REINSTALL = "reinstall it: pip install --force-reinstall casadi"
# kind of plug-in, its name in CasADi, what needs it
_PLUGINS = (
    ("nlpsol", "ipopt", "optimize"),
    ("linsol", "mumps", "optimize: linear equations inside Ipopt"),
    ("integrator", "idas", "simulate"),
    ("integrator", "cvodes", "simulate"),
    ("rootfinder", "newton", "consistent start values"),
)


@dataclass(frozen=True)
class Checked:
    """One line of the examination: what was looked for, what was found, and what to do if it is not good."""

    group: str
    name: str
    found: str
    good: bool = True
    essential: bool = True
    remedy: str = ""


def examine() -> list[Checked]:
    """Look for all that the toolkit needs or can use; nothing is changed."""
    return [_python(), *_packages(), *_plugins(), _compiler()]


def as_json(findings: list[Checked]) -> str:
    """The findings as a JSON object, with `ok` false if something essential is missing."""
    ok = all(finding.good or not finding.essential for finding in findings)
    return json.dumps({"ok": ok, "findings": [asdict(finding) for finding in findings]}, indent=2)


def show(findings: list[Checked]) -> None:
    """Print the findings as a table, and below it what to do."""
    from rich import box
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    table = Table("", "what", "found", box=box.SIMPLE, title="gantrytau doctor", title_justify="left")
    group = ""
    for finding in findings:
        if finding.group != group:
            group = finding.group
            table.add_row("", f"[bold]{group}[/bold]", "")
        mark = (
            "[green]ok[/green]" if finding.good else "[red]no[/red]" if finding.essential else "[dim]-[/dim]"
        )
        table.add_row(mark, escape(finding.name), escape(finding.found))
    console = Console()
    console.print(table)
    for finding in findings:
        if not finding.good:
            weight = "[red]missing[/red]" if finding.essential else "optional"
            console.print(f"{weight}: {escape(f'{finding.name}: {finding.remedy}')}", soft_wrap=True)


def _python() -> Checked:
    least = ".".join(map(str, _LEAST_PYTHON))
    return Checked(
        "python",
        "python",
        f"{platform.python_version()} on {platform.system()} {platform.machine()}",
        sys.version_info >= _LEAST_PYTHON,
        remedy=f"install Python {least} or newer",
    )


def _packages() -> Iterator[Checked]:
    """The toolkit itself, what it requires, and what its extras for users would add."""
    version = _version("gantrytau")
    if version is None:
        yield Checked("packages", "gantrytau", "not installed", False, remedy="pip install -e .")
        return
    yield Checked("packages", "gantrytau", version)
    for text in importlib.metadata.requires("gantrytau") or ():
        requirement = Requirement(text)
        if requirement.marker is None or requirement.marker.evaluate({"extra": ""}):
            yield _package(requirement)
    for extra in ("results", "view", "cross", "cluster"):
        yield _extra(extra)


def _package(requirement: Requirement) -> Checked:
    version = _version(requirement.name)
    good = version is not None and requirement.specifier.contains(version, prereleases=True)
    found = version or "not installed"
    expected = f"{found}, expected {requirement.specifier}" if not good else found
    return Checked("packages", requirement.name, expected, good, remedy=f"pip install '{requirement}'")


def _extra(extra: str) -> Checked:
    """Whether all packages of an extra are installed."""
    parts = [Requirement(text) for text in importlib.metadata.requires("gantrytau") or ()]
    names = [part.name for part in parts if part.marker and part.marker.evaluate({"extra": extra})]
    versions = {name: _version(name) for name in names}
    found = ", ".join(f"{name} {version or 'not installed'}" for name, version in versions.items())
    remedy = f"pip install 'gantrytau[{extra}]'"
    return Checked("extras", extra, found, None not in versions.values(), essential=False, remedy=remedy)


def _plugins() -> Iterator[Checked]:
    try:
        import casadi
    except ImportError as error:
        yield Checked("solvers", "casadi", f"cannot be imported: {error}", False, remedy=_REINSTALL)
        return
    for kind, name, purpose in _PLUGINS:
        there = bool(getattr(casadi, f"has_{kind}")(name))
        found = f"found ({purpose})" if there else f"not found; needed by {purpose}"
        yield Checked("solvers", name, found, there, remedy=f"casadi lacks this plug-in; {_REINSTALL}")


def _compiler() -> Checked:
    """The C compiler that `CC` names, else the first on the path."""
    candidates = [name for name in (os.environ.get("CC"), "cc", "gcc", "clang", "cl") if name]
    path = next((found for name in candidates if (found := shutil.which(name))), None)
    if path is None:
        remedy = (
            "needed to compile functions and FMUs; install gcc or clang (Debian, Ubuntu: apt install gcc)"
        )
        return Checked("compiler", "C compiler", "not found", False, essential=False, remedy=remedy)
    try:
        answer = subprocess.run(
            [path, "--version"], capture_output=True, text=True, timeout=10, check=False
        ).stdout
    except (OSError, subprocess.TimeoutExpired) as error:
        remedy = "repair it, or name another one in the environment variable CC"
        return Checked("compiler", "C compiler", f"{path}: {error}", False, essential=False, remedy=remedy)
    return Checked("compiler", "C compiler", ": ".join([path, *answer.splitlines()[:1]]), essential=False)


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None
