"""What is sent to another process: anything that Python can pickle, functions typed at a prompt and expressions too.

CasADi's expressions share their symbols, which would be lost one by one: they are written together, and the time of the
process that reads them takes the place of the time that was written.
"""

import importlib.util
import io
import pickle
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any

import casadi as ca

from gantrytau.language.symbols import time


def pack(thing: Any) -> bytes:
    """The bytes of a thing; what it holds of files that another process could not import goes along."""
    import cloudpickle

    class Packer(cloudpickle.Pickler):
        def persistent_id(self, obj: Any) -> int | None:
            if type(obj) is not ca.SX:
                return None
            if id(obj) not in places:
                places[id(obj)] = len(expressions)
                expressions.append(obj)
            return places[id(obj)]

    expressions: list[ca.SX] = [time]
    places: dict[int, int] = {id(time): 0}
    contents = io.BytesIO()
    with _whole(thing):
        Packer(contents).dump(thing)
    stream = ca.StringSerializer()
    stream.pack(expressions)
    return pickle.dumps((stream.encode(), contents.getvalue()))


def unpack(parcel: bytes) -> Any:
    """The thing that was packed, its expressions of the symbols of this process where they are of the time."""
    written, contents = pickle.loads(parcel)
    expressions = ca.StringDeserializer(written).unpack()
    foreign = expressions[0]
    timed = [k for k, e in enumerate(expressions) if ca.depends_on(e, foreign)]
    own = ca.substitute([expressions[k] for k in timed], [foreign], [time])
    for k, expression in zip(timed, own, strict=True):
        expressions[k] = expression

    class Unpacker(pickle.Unpickler):
        def persistent_load(self, pid: Any) -> ca.SX:
            return expressions[pid]

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
    import sys

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
        import sys

        path = getattr(sys.modules[before], "__path__", None) if before else None
        spec = importlib.machinery.PathFinder.find_spec(module.__name__, path)
    except (ImportError, KeyError, AttributeError, ValueError):
        return False
    return spec is not None and spec.origin == module.__file__
