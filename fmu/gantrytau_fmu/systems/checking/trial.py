"""A few steps of an FMU, to be run as a process of its own: `python trial.py FOLDER REPORT SUFFIX FOLDER_2 FOLDER_3`.

FOLDER holds the unpacked FMU, SUFFIX and the folders below `binaries` in both versions are those of this platform. Each
line of REPORT is JSON: the stage that begins, something found, or the end. The stage is written before each call into the
binary, so that a crash or a hang tells where it was. It imports nothing of the toolkit, and so begins at once.
"""

import ctypes
import json
import math
import sys
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

STEPS = 10
EVENTS = 100  # iterations of one event
_LAST = 3  # messages of the FMU that are repeated
_WORDS = {"ModelExchange": "Model Exchange", "CoSimulation": "Co-Simulation"}
_REAL = {"2.0": ("Real",), "3.0": ("Float64",)}


class Failure(Exception):
    """The FMU does not do what it should."""


class Journal:
    """The report: stages, findings, and the last messages of the FMU."""

    def __init__(self, file: Path):
        self.file = file.open("a", encoding="utf-8", buffering=1)
        self.interface, self.last = "", ""
        self.messages: deque[str] = deque(maxlen=_LAST)

    def write(self, **said: Any) -> None:
        """Add a line and see that it arrives."""
        self.file.write(json.dumps(said) + "\n")

    def stage(self, name: str) -> None:
        """What begins now."""
        if name != self.last:
            self.last = name
            self.write(stage=f"{self.interface}, {name}" if self.interface else name)

    def found(self, severity: str, message: str) -> None:
        """What is wrong."""
        told = f"; it says: {' | '.join(self.messages)}" if self.messages else ""
        self.messages.clear()
        self.write(severity=severity, message=f"{self.interface}, {message}{told}")

    def heard(self, *arguments: Any) -> None:
        """Keep a message of the FMU, of which the last argument of both versions is the text."""
        status, text = arguments[-3], arguments[-1]
        if isinstance(text, bytes) and status:
            self.messages.append(text.decode(errors="replace").strip()[:300])


def main(folder: Path, journal: Journal, platform: Sequence[str]) -> None:
    """Try each interface that the FMU has; platform: suffix and folders of its binaries."""
    journal.stage("reading the model description")
    from fmpy import read_model_description

    model = read_model_description(str(folder), validate=False)
    for kind, attempt in (("ModelExchange", _exchange), ("CoSimulation", _cosimulate)):
        interface = getattr(model, f"{kind[0].lower()}{kind[1:]}")
        if interface is None:
            continue
        journal.interface = _WORDS[kind]
        try:
            fmu = _loaded(folder, model, kind, interface.modelIdentifier, journal, platform)
            _instantiate(fmu, model, journal)
            attempt(fmu, model, journal)
            fmu.terminate()
            fmu.freeInstance()
        except Exception as error:  # Failure, FMPy's FMICallException, and plain Exception of FMPy
            journal.found("error", f"{journal.last}: {error}")
    if model.scheduledExecution is not None:
        journal.interface = "Scheduled Execution"
        journal.found("note", "not run: only the other interfaces are")


def _loaded(
    folder: Path, model: Any, kind: str, identifier: str, journal: Journal, platform: Sequence[str]
) -> Any:
    """The library, all functions of the interface in it; each call is told to the journal."""
    (suffix, *folders), two = platform, model.fmiVersion == "2.0"
    journal.stage("loading the binary")
    module = import_module("fmpy.fmi2" if two else "fmpy.fmi3")
    prefix = "fmi2" if two else "fmi3"
    made = getattr(module, f"FMU{prefix[-1]}{'Model' if kind == 'ModelExchange' else 'Slave'}")
    places = [folder / "binaries" / name / f"{identifier}{suffix}" for name in folders]
    library = next((place for place in (places if two else places[::-1]) if place.is_file()), places[0])
    found = ctypes.CDLL(str(library))
    needed = [name for name in dir(made) if name.startswith(prefix)]
    if missing := [name for name in needed if not hasattr(found, name)]:
        raise Failure(f"it does not export {', '.join(missing)}")

    class Told(made):
        def _call(self, name: str, *arguments: Any) -> Any:
            journal.stage(name)
            return super()._call(name, *arguments)

    Told.__name__ = made.__name__  # by which FMPy knows the version
    return Told(
        guid=model.guid,
        unzipDirectory=str(folder),
        modelIdentifier=identifier,
        instanceName="trial",
        libraryPath=str(library),
        requireFunctions=False,
    )


def _instantiate(fmu: Any, model: Any, journal: Journal) -> None:
    if model.fmiVersion != "2.0":
        fmu.instantiate(logMessage=journal.heard)
    else:
        fmi2 = import_module("fmpy.fmi2")
        callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(journal.heard)
        callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmi2.calloc)
        callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmi2.free)
        with suppress(Exception):  # then messages lack their arguments
            import_module("fmpy.logging").addLoggerProxy(ctypes.byref(callbacks))
        fmu.instantiate(callbacks=callbacks)
    version = fmu.getVersion()
    version = version.decode() if isinstance(version, bytes) else version
    if version[:3] != model.fmiVersion[:3]:
        raise Failure(f"found version {version}, expected {model.fmiVersion}")


def _experiment(model: Any) -> tuple[float, float, float | None]:
    """Start and stop in s, and the tolerance, where not said 0 s, 1 s later and None."""
    said = model.defaultExperiment
    start = float(said.startTime or 0.0) if said else 0.0
    stop = float(said.stopTime or start + 1.0) if said else 1.0
    return (
        start,
        stop if stop > start else start + 1.0,
        float(said.tolerance) if said and said.tolerance else None,
    )


def _initialize(fmu: Any, model: Any) -> tuple[float, float]:
    start, stop, tolerance = _experiment(model)
    if model.fmiVersion == "2.0":
        fmu.setupExperiment(tolerance=tolerance, startTime=start, stopTime=stop)
        fmu.enterInitializationMode()
    else:
        fmu.enterInitializationMode(tolerance=tolerance, startTime=start, stopTime=stop)
    fmu.exitInitializationMode()
    return start, stop


def _cosimulate(fmu: Any, model: Any, journal: Journal) -> None:
    """Steps, with a saved state on the way if it can save one."""
    start, stop = _initialize(fmu, model)
    _read(fmu, model, journal)
    said = model.defaultExperiment.stepSize if model.defaultExperiment else None
    fixed = model.coSimulation.fixedInternalStepSize
    step = float(said or fixed or (stop - start) / 100)
    count = max(1, min(STEPS, math.floor((stop - start) / step * (1 + 1e-9))))

    def advance(first: int, last: int) -> bool:
        return all(_goes_on(fmu, start + k * step, step) for k in range(first, last))

    if not advance(0, count - 1):
        _read(fmu, model, journal)
        return
    if model.coSimulation.canGetAndSetFMUstate:
        _restore(fmu, model, journal, lambda: advance(count - 1, count))
    else:
        advance(count - 1, count)
    _read(fmu, model, journal)


def _goes_on(fmu: Any, time: float, size: float) -> bool:
    """Take a step; false if the FMU asks to end the run there."""
    try:
        reply = fmu.doStep(time, size)
    except Exception as error:
        discarded = getattr(error, "status", None) == 2 and hasattr(fmu, "fmi2GetBooleanStatus")
        if discarded and fmu.getBooleanStatus(3):  # fmi2Terminated
            return False
        raise
    return not (reply and reply[1])


def _restore(fmu: Any, model: Any, journal: Journal, advance: Callable[[], bool]) -> None:
    """A step after a state is saved, and the same step once it is restored, give the same outputs."""
    two = model.fmiVersion == "2.0"
    get, put, free = (
        getattr(fmu, f"{word}{'FMUstate' if two else 'FMUState'}") for word in ("get", "set", "free")
    )
    state = get()
    if model.coSimulation.canSerializeFMUstate:
        text = (fmu.serializeFMUstate if two else fmu.serializeFMUState)(state)
        free(state)
        state = (fmu.deSerializeFMUstate if two else fmu.deserializeFMUState)(text)
    outputs = [unknown.variable for unknown in model.outputs if _readable(unknown.variable, model)]
    advance()
    first = _numbers(fmu, model, outputs)
    put(state)
    free(state)
    advance()
    second = _numbers(fmu, model, outputs)
    for variable, before, after in zip(outputs, first, second, strict=False):
        if before != after and not (math.isnan(before) and math.isnan(after)):
            message = f"{variable.name} is {before!r} after a step and {after!r} after the same step from the saved state"
            journal.found("warning", message)
            return


def _exchange(fmu: Any, model: Any, journal: Journal) -> None:
    """Small explicit Euler steps: whether all calls work, not how exact they are."""
    two = model.fmiVersion == "2.0"
    start, stop = _initialize(fmu, model)
    _read(fmu, model, journal)
    states, indicators = model.numberOfContinuousStates, model.numberOfEventIndicators
    if not two:
        told = fmu.getNumberOfContinuousStates(), fmu.getNumberOfEventIndicators()
        if told != (states, indicators):
            message = f"it tells of {told[0]} states and {told[1]} event indicators, expected {states} and {indicators}"
            raise Failure(message)
    x, rates = (ctypes.c_double * states)(), (ctypes.c_double * states)()
    signs = (ctypes.c_double * indicators)()
    _settle(fmu, two)
    step = (stop - start) * 1e-5
    for k in range(STEPS):
        if states:
            fmu.getContinuousStates(x, states)
            (fmu.getDerivatives if two else fmu.getContinuousStateDerivatives)(rates, states)
            _finite("states", x)
            _finite("derivatives", rates)
        fmu.setTime(start + (k + 1) * step)
        if states:
            x[:] = [value + step * rate for value, rate in zip(x, rates, strict=True)]
            fmu.setContinuousStates(x, states)
        if indicators:
            fmu.getEventIndicators(signs, indicators)
            _finite("event indicators", signs)
        event, ended = fmu.completedIntegratorStep()
        if ended:
            return
        if event:
            fmu.enterEventMode()
            _settle(fmu, two)
    _read(fmu, model, journal)


def _settle(fmu: Any, two: bool) -> None:
    """Iterate an event until nothing changes any more."""
    for _ in range(EVENTS):
        needed = (fmu.newDiscreteStates if two else fmu.updateDiscreteStates)()[0]
        if not needed:
            fmu.enterContinuousTimeMode()
            return
    raise Failure(f"found changes after {EVENTS} iterations of one event, expected an end")


def _finite(what: str, values: Sequence[float]) -> None:
    for place, value in enumerate(values):
        if not math.isfinite(value):
            raise Failure(f"number {place + 1} of the {what} is {value}, expected a finite number")


def _readable(variable: Any, model: Any) -> bool:
    """Whether it is a number that can be read at any time."""
    return variable.type in _REAL[model.fmiVersion[:3]] and not variable.clocks and variable.alias is None


def _numbers(fmu: Any, model: Any, variables: Iterable[Any]) -> list[float]:
    """Values of real variables; arrays give all their elements."""
    found: list[float] = []
    variables = list(variables)
    if model.fmiVersion == "2.0":
        return fmu.getReal([variable.valueReference for variable in variables]) if variables else found
    for variable in variables:
        found += fmu.getFloat64([variable.valueReference], math.prod(variable.shape))
    return found


def _read(fmu: Any, model: Any, journal: Journal) -> None:
    """Read every real variable, event indicators among them; name those that cannot be read or are not finite."""
    indicators = {id(unknown.variable) for unknown in model.eventIndicators}
    for variable in model.modelVariables:
        if not _readable(variable, model):
            continue
        what = "event indicator" if id(variable) in indicators else variable.causality
        try:
            values = _numbers(fmu, model, [variable])
        except Exception as error:
            raise Failure(f"the {what} {variable.name} cannot be read ({error})") from error
        if not all(map(math.isfinite, values)) and variable.causality == "output":
            journal.found("warning", f"{variable.name} is {values[0]}, expected a finite number")


if __name__ == "__main__":
    # not on Windows; and no file as large as the memory after a crash
    with suppress(ImportError, ValueError):
        limits = import_module("resource")
        limits.setrlimit(limits.RLIMIT_CORE, (0, 0))
    report = Journal(Path(sys.argv[2]))
    main(Path(sys.argv[1]), report, sys.argv[3:])
    report.write(finished=True)
