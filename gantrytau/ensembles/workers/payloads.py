"""What is sent to another process: anything that Python can pickle, functions typed at a prompt and expressions too.

CasADi's expressions share their symbols, which would be lost one by one: they are written together, and the time of the
process that reads them takes the place of the time that was written.
"""

import importlib.machinery
import io
import pickle
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any

import casadi as ca

from gantrytau.language.symbols import time

KINDS = (ca.SX, ca.MX)  # of expressions; those of the time are SX


def pack(thing: Any) -> bytes:
    """The bytes of a thing; what it holds of files that another process could not import goes along."""
    import cloudpickle

    class Packer(cloudpickle.Pickler):
        def persistent_id(self, obj: Any) -> tuple[int, int] | None:
            if type(obj) not in KINDS:
                return None
            if id(obj) not in places:
                kind = KINDS.index(type(obj))
                places[id(obj)] = kind, len(expressions[kind])
                expressions[kind].append(obj)
            return places[id(obj)]

    expressions: tuple[list[Any], ...] = ([time], [])
    places: dict[int, tuple[int, int]] = {id(time): (0, 0)}
    contents = io.BytesIO()
    with _whole(thing):
        Packer(contents).dump(thing)
    stream = ca.StringSerializer()
    for one in expressions:
        stream.pack(len(one))
        if one:
            stream.pack(one)
    return pickle.dumps((stream.encode(), contents.getvalue()))


def unpack(parcel: bytes) -> Any:
    """The object in a payload; the symbol of time in its expressions becomes the one of this process."""
    written, contents = pickle.loads(parcel)
    stream = ca.StringDeserializer(written)
    expressions = []
    for _ in KINDS:
        count = stream.unpack()
        expressions.append(stream.unpack() if count else [])
    foreign = expressions[0][0]
    timed = [k for k, e in enumerate(expressions[0]) if ca.depends_on(e, foreign)]
    own = ca.substitute([expressions[0][k] for k in timed], [foreign], [time])
    for k, expression in zip(timed, own, strict=True):
        expressions[0][k] = expression

    class Unpacker(pickle.Unpickler):
        def persistent_load(self, pid: tuple[int, int]) -> Any:
            return expressions[pid[0]][pid[1]]

    return Unpacker(io.BytesIO(contents)).load()


@contextmanager
def _whole(thing: Any) -> Iterator[None]:
    """While it lasts, classes and functions of a file that was loaded by its path are pickled whole."""
    import cloudpickle

    known = cloudpickle.list_registry_pickle_by_value()
    loaded = [m for m in _modules(thing) if m.__name__ not in known and not _importable(m)]
    for module in loaded:
        cloudpickle.register_pickle_by_value(module)
    try:
        yield
    finally:
        for module in loaded:
            cloudpickle.unregister_pickle_by_value(module)


def _modules(thing: Any) -> list[ModuleType]:
    """The modules of a function, of the classes of a thing, and of what a record holds."""
    parts = [thing, *(vars(thing).values() if hasattr(thing, "__dict__") else ())]
    names = {getattr(part, "__module__", None) for part in parts}
    names |= {cls.__module__ for part in parts for cls in type(part).__mro__}
    return [sys.modules[name] for name in sorted(filter(None, names)) if name in sys.modules]


def _importable(module: ModuleType) -> bool:
    """Whether another process finds the same file under the module's name; cloudpickle itself sees to `__main__`."""
    if module.__name__ == "__main__" or getattr(module, "__file__", None) is None:
        return True
    before, _, _ = module.__name__.rpartition(".")
    try:
        path = getattr(sys.modules[before], "__path__", None) if before else None
        spec = importlib.machinery.PathFinder.find_spec(module.__name__, path)
    except (ImportError, KeyError, AttributeError, ValueError):
        return False
    return spec is not None and spec.origin == module.__file__
