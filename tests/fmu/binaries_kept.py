"""Libraries and programs compiled in an earlier run or by another file, found by all that they are made of.

The key is a hash of the sources, the options and the compiler's own file. They stand in `.pytest_cache/binaries`, and go
with it; what nobody asked for in two weeks is removed.
"""

import hashlib
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from gantrytau_fmu.building import compile_libraries
from gantrytau_fmu.building.platforms import Platform

FOLDER = Path(__file__).parents[2] / ".pytest_cache" / "binaries"
UNUSED = 14 * 86_400  # s


def binary(command: Sequence[str], sources: Mapping[str, str], make: Callable[[], bytes]) -> bytes:
    """What `make` compiles; command: the compiler and its options, without names of files."""
    key = _key(command, sources)
    found = _found(key)
    return _keep(key, make()) if found is None else found


def libraries(
    sources: Mapping[str, str], platforms: Sequence[Platform], *, identifier: str, optimisation: str = "-O2"
) -> dict[Platform, bytes]:
    """As `compile_libraries`."""
    keys = {}
    for platform in platforms:
        command = compile_libraries.compiler(platform)
        zig = "ziglang" in command
        options = compile_libraries.flags(platform, identifier, zig=zig)
        keys[platform] = _key([*command, *options, optimisation], sources)
    found = {platform: data for platform in platforms if (data := _found(keys[platform])) is not None}
    missing = [platform for platform in platforms if platform not in found]
    made = compile_libraries.compile_libraries(
        sources, missing, identifier=identifier, optimisation=optimisation
    )
    found |= {platform: _keep(keys[platform], data) for platform, data in made.items()}
    return {platform: found[platform] for platform in platforms}


def remove_old() -> None:
    """Remove what has not been used for long."""
    for file in FOLDER.glob("*"):
        if time.time() - file.stat().st_mtime > UNUSED:
            file.unlink(missing_ok=True)


def _key(command: Sequence[str], sources: Mapping[str, str]) -> str:
    program = Path(shutil.which(command[0]) or command[0]).resolve()
    state = program.stat()
    parts = (str(program), state.st_mtime_ns, state.st_size, command[1:], sorted(sources.items()))
    return hashlib.sha256(repr(parts).encode()).hexdigest()


def _found(key: str) -> bytes | None:
    file = FOLDER / key
    try:
        os.utime(file)
        return file.read_bytes()
    except FileNotFoundError:
        return None


def _keep(key: str, data: bytes) -> bytes:
    FOLDER.mkdir(parents=True, exist_ok=True)
    handle, partial = tempfile.mkstemp(dir=FOLDER)
    with os.fdopen(handle, "wb") as file:
        file.write(data)
    os.replace(partial, FOLDER / key)  # whole, also beside other workers
    return data
