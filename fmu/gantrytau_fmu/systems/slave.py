"""One running instance of a Co-Simulation FMU, through FMPy; values go in and out by name.

A slave of FMPy raises bare exceptions; here each failure becomes a SolveError that names the component, says at
which time it was, and repeats what the FMU wrote to its log last.
"""

import ctypes
import re
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from gantrytau.border.refusal import GantryTauError, InitializationError, ModelError, SolveError
from gantrytau_fmu.systems.component import Component, Scalar

LAST = 12  # messages kept of the log
ERRORS = ("logStatusError", "logStatusFatal", "logStatusWarning")  # categories that FMI predefines
STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")

DISCARD, LAST_TIME, TERMINATED = 2, 2, 3  # statuses and kinds of status in FMI 2

Values = Sequence[float]


class RunEnded(GantryTauError):
    """A component, `owner`, asks to end the run: when, s, for which reason, and the values it has then."""

    def __init__(self, owner: str, time: float, reason: str, values: Values):
        super().__init__(reason, place=owner)
        self.owner, self.time, self.reason, self.values = owner, time, reason, list(values)

    def __reduce__(self) -> tuple[type, tuple[Any, ...]]:
        return RunEnded, (self.owner, self.time, self.reason, self.values)


_TYPES_2 = {
    "Real": ctypes.c_double,
    "Integer": ctypes.c_int,
    "Boolean": ctypes.c_int,
    "String": ctypes.c_char_p,
}
_TYPES_3 = {
    "Float64": ctypes.c_double,
    "Float32": ctypes.c_float,
    **{
        f"{sign}Int{bits}": getattr(ctypes, f"c_{sign.lower()}int{bits}")
        for sign in ("", "U")
        for bits in (8, 16, 32, 64)
    },
    "Boolean": ctypes.c_bool,
    "String": ctypes.c_char_p,
}


class Slave:
    """A running instance of a component.

    Order of calls: `begin`, then `get` and `set` in initialisation, `started`, then `step`, `save`, `restore`, and
    `close` in every case. Names are those of scalars of the component, and tuples of them are looked up once.
    """

    def __init__(self, component: Component):
        self.component = component
        self.time = 0.0
        self.log: deque[str] = deque(maxlen=LAST)
        self.state: Any = None
        self.running = False
        self.groups: dict[tuple[str, ...], list[_Group]] = {}
        self.fmu: Any = _loaded(component)
        self._instantiate()

    def begin(
        self, start: Mapping[str, float | str], begin: float, stop: float, tolerance: float | None
    ) -> None:
        """Set start values and enter initialisation."""
        self.time = begin
        for name, value in start.items():
            self._set_start(name, value)
        if self.component.version == 2:
            self._call("fmi2SetupExperiment", self.fmu.setupExperiment, tolerance, begin, stop)
            self._call("fmi2EnterInitializationMode", self.fmu.enterInitializationMode)
        else:
            self._call(
                "fmi3EnterInitializationMode", self.fmu.enterInitializationMode, tolerance, begin, stop
            )

    def started(self) -> None:
        """Leave initialisation."""
        self._call("ExitInitializationMode", self.fmu.exitInitializationMode)
        self.running = True

    def get(self, names: tuple[str, ...]) -> list[float]:
        """Values by name."""
        values = [0.0] * len(names)
        for group in self._grouped(names):
            self._call(f"reading {_few(names)}", group.read, self.fmu)
            for place, index in zip(group.places, group.indices, strict=True):
                values[place] = float(group.buffer[index])
        return values

    def set(self, names: tuple[str, ...], values: Values) -> None:
        """Set values by name."""
        for group in self._grouped(names):
            if group.partial:
                self._call(f"reading {_few(names)}", group.read, self.fmu)
            for place, index in zip(group.places, group.indices, strict=True):
                group.buffer[index] = group.converted(values[place])
            self._call(f"setting {_few(names)}", group.write, self.fmu)

    def step(
        self,
        time: float,
        size: float,
        known: tuple[str, ...],
        values: Values,
        wanted: tuple[str, ...],
    ) -> list[float]:
        """Set inputs, step from `time` over `size`, and get values. RunEnded where the component ends the run."""
        self.time = time
        self.set(known, values)
        ended = self._stepped(time, size)
        self.time = time + size if ended is None else ended
        found = self.get(wanted)
        if ended is not None:
            name = self.component.name
            raise RunEnded(name, ended, ended_in_words(self.log, self.component.title), found)
        return found

    def _stepped(self, time: float, size: float) -> float | None:
        """Take a step; the time at which the component ended the run, s, if it did."""
        try:
            reply = self._call("step", self.fmu.doStep, time, size)
        except SolveError as error:
            discarded = getattr(error.__cause__, "status", None) == DISCARD and self.component.version == 2
            if discarded and self._call("fmi2GetBooleanStatus", self.fmu.getBooleanStatus, TERMINATED):
                return float(self._call("fmi2GetRealStatus", self.fmu.getRealStatus, LAST_TIME))
            raise
        return float(reply[3]) if reply and reply[1] else None

    def save(self) -> None:
        """Keep the present state, in place of the one kept before."""
        if self.state is None:
            self.state = ctypes.c_void_p()
        call = self.fmu.fmi2GetFMUstate if self.component.version == 2 else self.fmu.fmi3GetFMUState
        self._call("saving the state", call, self.fmu.component, ctypes.byref(self.state))

    def restore(self) -> None:
        """Go back to the state kept last."""
        call = self.fmu.fmi2SetFMUstate if self.component.version == 2 else self.fmu.fmi3SetFMUState
        self._call("restoring the state", call, self.fmu.component, self.state)

    def close(self) -> None:
        """Terminate and free the instance, whatever happened before."""
        fmu, self.fmu = self.fmu, None
        if fmu is None or not fmu.component:
            return
        if self.state:
            free = fmu.fmi2FreeFMUstate if self.component.version == 2 else fmu.fmi3FreeFMUState
            with suppress(Exception):
                free(fmu.component, ctypes.byref(self.state))
        if self.running:
            with suppress(Exception):
                fmu.terminate()
        with suppress(Exception):
            fmu.freeInstance()
        _LOGS.pop(id(self), None)

    def _instantiate(self) -> None:
        """The instance, with its errors and warnings logged; all messages where it has no categories for them."""
        try:
            if self.component.version == 2:
                _LOGS[id(self)] = self.log
                self.fmu.instantiate(callbacks=_callbacks(id(self)), loggingOn=True)
            else:
                self.fmu.instantiate(loggingOn=True, logMessage=self._heard)
        except Exception as error:
            self.fmu.component = None
            _LOGS.pop(id(self), None)
            raise InitializationError(
                f"{self.component.title}: {self.component.file} could not be instantiated{self._said()}; "
                "`gantrytau fmu check --run` looks for the reason"
            ) from error
        chosen = [name for name in ERRORS if name in self.component.categories]
        with suppress(Exception):
            self.fmu.setDebugLogging(False, [])
            if chosen:
                self.fmu.setDebugLogging(True, chosen)

    def _set_start(self, name: str, value: float | str) -> None:
        if isinstance(value, str):
            reference = [self.component.scalars[name].reference]
            self._call(f"setting {name}", self.fmu.setString, reference, [value.encode()])
        else:
            self.set((name,), (value,))

    def _grouped(self, names: tuple[str, ...]) -> list["_Group"]:
        if names not in self.groups:
            by_type: dict[str, list[tuple[int, Scalar]]] = {}
            for place, name in enumerate(names):
                scalar = self.component.scalars[name]
                by_type.setdefault(_access(scalar.type, self.component.version), []).append((place, scalar))
            self.groups[names] = [
                _Group(self.component.version, kind, members) for kind, members in by_type.items()
            ]
        return self.groups[names]

    def _heard(self, environment: Any, status: int, category: bytes, message: bytes) -> None:
        self.log.append((message or b"").decode("utf-8", "replace").strip())

    def _call(self, what: str, function: Callable[..., Any], *arguments: Any) -> Any:
        try:
            return function(*arguments)
        except KeyboardInterrupt:
            raise
        except Exception as error:
            status = getattr(error, "status", -1)
            words = f"status '{STATUS[status]}'" if status in range(len(STATUS)) else str(error)
            raise self._failure(f"{what}: {words}") from error

    def _failure(self, words: str) -> SolveError | InitializationError:
        message = (
            f"{self.component.title}: {words} at t = {self.time:.6g} s{self._said()}; {self._remedy(words)}"
        )
        if self.running:
            return SolveError(message, time=self.time)
        return InitializationError(f"{message} (while it was initialised)")

    def _remedy(self, words: str) -> str:
        file = Path(self.component.file).name
        if "'fatal'" in words:
            return (
                f"{file} cannot go on and may harm this process: run it with isolate=True, and ask its author"
            )
        if self.log:
            return f"mend what {file} complains of, by other inputs, start values or a shorter step"
        return f"{file} does not say why: try other inputs, start values or a shorter step, or ask its author"

    def _said(self) -> str:
        return f"; its log says: {' | '.join(self.log)}" if self.log else ""


class _Group:
    """Variables of one type that are read or written in one call.

    places: in the caller's tuple; indices: of the same in the buffer, which holds whole arrays.
    """

    def __init__(self, version: int, kind: str, members: Sequence[tuple[int, Scalar]]):
        sizes = {scalar.reference: scalar.size for _, scalar in members}
        offsets, total = {}, 0
        for reference, size in sizes.items():
            offsets[reference] = total
            total += size
        self.version = version
        self.places = [place for place, _ in members]
        self.indices = [offsets[scalar.reference] + scalar.place for _, scalar in members]
        self.partial = len(set(self.indices)) < total
        self.references = (ctypes.c_uint * len(sizes))(*sizes)
        types = _TYPES_2 if version == 2 else _TYPES_3
        self.buffer = (types[kind] * total)()
        self.names = (f"fmi{version}Get{kind}", f"fmi{version}Set{kind}")
        self.converted: Callable[[float], Any] = (
            float if kind in ("Real", "Float64", "Float32") else _truth if kind == "Boolean" else round
        )

    def read(self, fmu: Any) -> None:
        self._transfer(fmu, self.names[0])

    def write(self, fmu: Any) -> None:
        self._transfer(fmu, self.names[1])

    def _transfer(self, fmu: Any, name: str) -> None:
        arguments = (fmu.component, self.references, len(self.references), self.buffer)
        if self.version == 3:
            arguments += (len(self.buffer),)
        fmu._call(name, *arguments)


def _truth(value: float) -> bool:
    return value != 0


def _access(kind: str, version: int) -> str:
    """The type in the names of the functions that read and write: enumerations are integers."""
    if kind == "Enumeration":
        return "Integer" if version == 2 else "Int64"
    return kind


def ended_in_words(log: Iterable[str], name: str) -> str:
    """The reason why a component ended the run, from the log of its FMU; without one, the fact alone."""
    for line in reversed(list(log)):
        found = re.search(r"ended at time = [^:]* s: (.*)", line)
        if found:
            return found[1].strip()
    return f"{name} asked to end the run"


def _few(names: Sequence[str]) -> str:
    return ", ".join(names[:4]) + (", ..." if len(names) > 4 else "")


def _loaded(component: Component) -> Any:
    """The shared library as FMPy's slave; ModelError if it cannot be loaded or lacks functions."""
    from fmpy.fmi2 import FMU2Slave
    from fmpy.fmi3 import FMU3Slave

    arguments = dict(
        guid=component.token,
        unzipDirectory=component.folder,
        modelIdentifier=component.identifier,
        instanceName=component.title,
    )
    try:
        if component.version == 2:
            return FMU2Slave(**arguments, libraryPath=component.library)
        return FMU3Slave(**arguments)
    except Exception as error:
        raise ModelError(
            f"{component.title}: the binary in {component.file} cannot be used: {error}; "
            "it may need libraries that are missing here, `gantrytau fmu check` says more"
        ) from error


# FMI 2 passes the log message as a format with arguments, which only C can write out: FMPy's proxy does it and
# then calls one function for all instances. The environment of an instance is the key of its log.
_LOGS: dict[int, deque[str]] = {}
_HOOKS: list[Any] = []


def _callbacks(key: int) -> Any:
    from fmpy import calloc, fmi2, free

    if not _HOOKS:
        _HOOKS.append(fmi2.fmi2CallbackLoggerTYPE(_heard_2))
    callbacks = fmi2.fmi2CallbackFunctions()
    callbacks.logger = _HOOKS[0]
    callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(calloc)
    callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(free)
    callbacks.componentEnvironment = key
    with suppress(Exception):  # without the proxy formats stay as they are
        from fmpy.logging import addLoggerProxy

        addLoggerProxy(ctypes.byref(callbacks))
    return callbacks


def hook_log() -> None:
    """After a run in which FMPy had a logger of its own: its proxy must not call one that is gone."""
    _callbacks(0)


def _heard_2(environment: Any, name: bytes, status: int, category: bytes, message: bytes) -> None:
    text = (message or b"").decode("utf-8", "replace").strip()
    if environment in _LOGS:
        _LOGS[environment].append(text)
    else:
        print(text)  # of an instance that FMPy runs by itself
