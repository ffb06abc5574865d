"""What is wrong with an FMU: its archive, its model description, and on request how it runs."""

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Collection, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from gantrytau.border.checks import number
from gantrytau.border.refusal import ModelError
from gantrytau.interruption import uninterrupted
from gantrytau_fmu.building.platforms import native
from gantrytau_fmu.reading.fmu_findings import FmuFinding, errors_first, fault
from gantrytau_fmu.reading.inconsistencies import inconsistencies
from gantrytau_fmu.reading.read_fmu import describe, model_of, read_files, schema_problems
from gantrytau_fmu.reading.reference_results import ReferenceResults, references_of
from gantrytau_fmu.reading.safety import unpack
from gantrytau_fmu.systems.checking.rerun_reference import rerun

TIMEOUT = 60.0  # s for a trial run of all interfaces
_REPORT = 1_000_000  # bytes of the report of a trial run that are read
_PART = r"[A-Za-z_][A-Za-z_0-9]*(\[[0-9]+(,[0-9]+)*\])?"
_NAME = rf"{_PART}(\.{_PART})*"
_PLAIN = re.compile(
    rf"{_NAME}|der\({_NAME}(,[0-9]+)?\)"
)  # structured names without quotes, good in both conventions
_OURS = (  # of FMPy: said by us with names, and without its mistakes
    'The unit "',
    "ModelStructure/Outputs must have exactly",
    "ModelStructure/InitialUnknowns does not",
)


def check_fmu(
    path: str | os.PathLike[str], *, run: bool = False, timeout: float = TIMEOUT
) -> list[FmuFinding]:
    """All that is wrong with an FMU, errors first; [] if nothing is.

    Looks at the archive (`safety`), the official schemas, what FMPy validates, and what neither of them does: limits
    and start values, units, the model structure by name, terminals, sources, which binaries are in it, and reference
    results: those that its manifest of FMI-LS-REF (beta) lists, or `NAME_ref.csv` and `NAME_in.csv` beside `NAME.fmu`.
    run: also load its binary for this machine and simulate a few steps, in a process of its own, so that a crash, or
    no answer within `timeout` seconds, is a finding. Nothing of the FMU is loaded without it. Reference results are run
    again: the first signal that leaves them is a finding, and a note says that none does.
    """
    timeout = number("check_fmu", "timeout", timeout, above=0.0, unit="s")
    path = Path(path)
    return [replace(finding, path=str(path)) for finding in errors_first(_found(path, run, timeout))]


def _found(path: Path, run: bool, timeout: float) -> list[FmuFinding]:
    try:
        files = read_files(path)
        if problems := schema_problems(files):
            return [fault(problem) for problem in problems]
        model = model_of(files)
        fmu = describe(files, model)
    except ModelError as error:
        return [fault(str(error))]
    findings = list(inconsistencies(fmu, files, model))
    for problem in _validated(files.packed(), (variable.name for variable in fmu.variables)):
        tripped = problem.startswith("KeyError") and findings  # over a unit that we found to be undefined
        if not tripped and not problem.startswith(_OURS):
            findings.append(FmuFinding("error", problem))
    try:
        references = list(references_of(fmu))
    except ModelError as error:
        references = [fault(str(error))]
    findings += [one for one in references if isinstance(one, FmuFinding)]
    if run:
        findings += _tried(path, fmu.platforms, timeout)
        if native().name in fmu.platforms and not any(one.severity == "error" for one in findings):
            for one in references:
                findings += rerun(fmu, one) if isinstance(one, ReferenceResults) else ()
    return findings


def _validated(packed: Any, names: Iterable[str]) -> list[str]:
    """What `fmpy.validate_fmu` says, without its 3 ms for each name where the names are plain."""
    from fmpy.model_description import ValidationError, read_model_description

    plain = all(_PLAIN.fullmatch(name) for name in names)
    try:
        read_model_description(
            packed, validate=True, validate_variable_names=not plain, validate_model_structure=True
        )
    except ValidationError as error:
        return [problem.strip() for problem in error.problems]
    except Exception as error:  # as FMPy itself, which trips over undefined display units
        return [f"{type(error).__name__}: {error}"]
    return []


def _tried(path: Path, platforms: Collection[str], timeout: float) -> Iterator[FmuFinding]:
    """What happens when the FMU is run in a process of its own."""
    here = native()
    if here.name not in platforms:
        yield FmuFinding("warning", f"not run: it has no binary for this machine ({here.name})")
        return
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        report = Path(folder) / "report"
        report.touch()
        unpacked = unpack(path, Path(folder) / "unpacked")
        arguments = [str(unpacked), str(report), here.suffix, here.folder_2, here.folder_3]
        code = _run_apart(arguments, folder, timeout)
        stage, findings, finished = _reported(report)
    yield from findings
    if finished:
        return
    if code is None:
        yield fault(f"{stage}: no answer after {timeout:g} s")
    else:
        yield fault(f"{stage}: the process ended ({_ending(code)})")


def _run_apart(arguments: list[str], folder: str, timeout: float) -> int | None:
    """Run `trial` in a process of its own; its exit code, None if it had to be stopped. No process is left."""
    command = [sys.executable, "-P", str(Path(__file__).with_name("trial.py")), *arguments]
    silent = subprocess.DEVNULL
    with uninterrupted():
        process = subprocess.Popen(
            command, cwd=folder, stdin=silent, stdout=silent, stderr=silent, start_new_session=True
        )
    try:
        return process.wait(timeout)
    except subprocess.TimeoutExpired:
        return None
    finally:
        with suppress(OSError):  # it has ended
            if hasattr(os, "killpg"):
                os.killpg(process.pid, signal.SIGKILL)  # with all processes that it started
            else:
                process.kill()
        process.wait()


def _reported(report: Path) -> tuple[str, list[FmuFinding], bool]:
    """The last stage that a trial run began, what it found, and whether it came to its end."""
    stage, findings, finished = "start", [], False
    with report.open("rb") as file:
        lines = file.read(_REPORT).splitlines()
    for line in lines:
        with suppress(ValueError, TypeError, AttributeError):  # a line that was cut off
            said = json.loads(line)
            stage = str(said.get("stage", stage))
            finished = finished or said.get("finished") is True
            if said.get("severity") in ("error", "warning", "note"):
                findings.append(FmuFinding(said["severity"], str(said["message"])))
    return stage, findings, finished


def _ending(code: int) -> str:
    """How a process ended, in words."""
    if code < 0:
        with suppress(ValueError):
            return signal.Signals(-code).name
    return f"exit code {code}"
