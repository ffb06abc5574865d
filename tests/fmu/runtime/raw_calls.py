"""The C functions of an FMU, called as they are: no order kept, no argument checked on this side."""

import ctypes
import math
from collections.abc import Sequence
from ctypes import (
    CDLL,
    CFUNCTYPE,
    POINTER,
    Structure,
    byref,
    c_bool,
    c_char_p,
    c_double,
    c_int,
    c_size_t,
    c_uint,
    c_void_p,
    cast,
)
from pathlib import Path
from typing import Any, Literal

OK, WARNING, DISCARD, ERROR, FATAL = range(5)
Kind = Literal["ModelExchange", "CoSimulation"]

LOGGER_2 = CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p)
LOGGER_3 = CFUNCTYPE(None, c_void_p, c_int, c_char_p, c_char_p)


class Callbacks(Structure):
    _fields_ = (
        ("logger", LOGGER_2),
        ("allocate", c_void_p),
        ("free", c_void_p),
        ("finished", c_void_p),
        ("environment", c_void_p),
    )


class EventInfo(Structure):
    _fields_ = (
        *((name, c_int) for name in ("again", "terminate", "nominals", "states", "defined")),
        ("next", c_double),
    )


def integers(values: Sequence[int]) -> Any:
    return (c_uint * len(values))(*values)


def reals(values: Sequence[float]) -> Any:
    return (c_double * len(values))(*values)


class Library:
    """A shared library with the functions of FMI 2 or 3; `messages` are the lines that its instances told."""

    def __init__(self, path: Path, version: Literal[2, 3], token: str):
        self.library = CDLL(str(path))
        self.version = version
        self.token = token
        self.messages: list[tuple[str, str]] = []
        tell = self.messages.append
        if version == 2:
            self.logger: Any = LOGGER_2(
                lambda _e, _n, _s, category, text: tell((category.decode(), text.decode()))
            )
            self.callbacks = Callbacks(logger=self.logger)
        else:
            self.logger = LOGGER_3(lambda _e, _s, category, text: tell((category.decode(), text.decode())))

    def function(self, name: str) -> Any:
        return getattr(self.library, f"fmi{self.version}{name}")

    def instantiate(
        self,
        kind: Kind,
        *,
        name: str | None = "test",
        token: str | None = None,
        logging: bool = False,
        event_mode: bool = False,
    ) -> "Instance | None":
        token = self.token if token is None else token
        texts = (c_char_p(name.encode() if name is not None else None), c_char_p(token.encode()))
        if self.version == 2:
            create = self.function("Instantiate")
            number = 0 if kind == "ModelExchange" else 1
            arguments = (texts[0], number, texts[1], c_char_p(b""), byref(self.callbacks), 0, int(logging))
        else:
            create = self.function("Instantiate" + kind)
            arguments = (*texts, c_char_p(b""), c_bool(False), c_bool(logging))
            if kind == "CoSimulation":
                arguments += (c_bool(event_mode), c_bool(False), None, c_size_t(0))
            arguments += (None, self.logger) + ((None,) if kind == "CoSimulation" else ())
        create.restype = c_void_p
        pointer = create(*arguments)
        return Instance(self, pointer) if pointer else None


class Instance:
    """An instance; its methods return the status, or the status and a result."""

    def __init__(self, library: Library, pointer: int):
        self.library = library
        self.version = library.version
        self.pointer = c_void_p(pointer)

    def __call__(self, name: str, *arguments: Any) -> int:
        """The function without its prefix `fmi2` or `fmi3`."""
        return self.library.function(name)(self.pointer, *arguments)

    @property
    def message(self) -> str:
        """What was told last."""
        return self.library.messages[-1][1]

    def free(self) -> None:
        release = self.library.function("FreeInstance")
        release.restype = None
        release(self.pointer)

    def enter(self, start: float = 0.0, stop: float | None = None, tolerance: float | None = None) -> int:
        """Up to initialization mode."""
        boolean = c_int if self.version == 2 else c_bool
        times = (
            boolean(tolerance is not None),
            c_double(tolerance or 0.0),
            c_double(start),
            boolean(stop is not None),
            c_double(stop or 0.0),
        )
        if self.version == 3:
            return self("EnterInitializationMode", *times)
        status = self("SetupExperiment", *times)
        return status if status >= DISCARD else self("EnterInitializationMode")

    def start(self, stop: float | None = None) -> int:
        """Up to step mode or event mode."""
        status = self.enter(stop=stop)
        return status if status >= DISCARD else self("ExitInitializationMode")

    def get(self, *references: int) -> tuple[int, list[float]]:
        values = reals([math.nan] * len(references))
        return self._values("Get", references, values), list(values)

    def set(self, reference: int, value: float) -> int:
        return self._values("Set", (reference,), reals([value]))

    def _values(self, verb: str, references: Sequence[int], values: Any) -> int:
        count = c_size_t(len(references))
        if self.version == 2:
            return self(verb + "Real", integers(references), count, values)
        return self(verb + "Float64", integers(references), count, values, count)

    def step(self, point: float, size: float) -> int:
        if self.version == 2:
            return self("DoStep", c_double(point), c_double(size), 1)
        self.flags, self.reached = (c_bool(True), c_bool(True), c_bool(True)), c_double(math.nan)
        return self(
            "DoStep",
            c_double(point),
            c_double(size),
            c_bool(True),
            *map(byref, self.flags),
            byref(self.reached),
        )

    def update(self) -> int:
        """One event iteration."""
        if self.version == 2:
            return self("NewDiscreteStates", byref(EventInfo()))
        flags = [c_bool() for _ in range(5)]
        return self("UpdateDiscreteStates", *map(byref, flags), byref(c_double()))

    @property
    def word(self) -> str:
        """How the version spells "state" in the names of functions."""
        return "FMUstate" if self.version == 2 else "FMUState"

    def save(self) -> c_void_p:
        state = c_void_p()
        assert self("Get" + self.word, byref(state)) == OK
        return state

    def restore(self, state: c_void_p | None) -> int:
        return self("Set" + self.word, state)

    def forget(self, state: c_void_p) -> int:
        return self("Free" + self.word, byref(state))

    def serialize(self, state: c_void_p) -> bytes:
        size = c_size_t()
        assert self(f"Serialized{self.word}Size", state, byref(size)) == OK
        data = ctypes.create_string_buffer(size.value)
        assert self("Serialize" + self.word, state, data, size) == OK
        return data.raw

    def deserialize(self, data: bytes) -> tuple[int, c_void_p]:
        state = c_void_p()
        name = ("DeSerialize" if self.version == 2 else "Deserialize") + self.word
        return self(name, data, c_size_t(len(data)), byref(state)), state

    def logging(self, on: bool, *categories: str) -> int:
        names = (c_char_p * len(categories))(*(name.encode() for name in categories))
        boolean = c_int if self.version == 2 else c_bool
        return self("SetDebugLogging", boolean(on), c_size_t(len(categories)), cast(names, POINTER(c_char_p)))
