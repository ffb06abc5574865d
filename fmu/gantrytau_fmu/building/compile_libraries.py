"""Compiles the sources of an FMU, one unit, into a shared library for each platform.

For this machine its own C compiler does it; for a platform named by its name ziglang does it, also on that
platform itself: with Linux against glibc 2.17, Windows 10 and macOS 11, all on one machine. Floating-point
operations are never fused, so that all platforms round alike.
"""

import importlib.util
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from gantrytau.border.refusal import GantryTauError, ModelError
from gantrytau.interruption import uninterrupted
from gantrytau.kernels import c_compiler
from gantrytau_fmu.building.platforms import Platform

UNIT = "fmu.c"  # the one file that is compiled; it includes the others
_OUTPUT, _MESSAGES = "library", "messages.txt"  # in a folder of each platform
_FAILURE = re.compile("error|undefined", re.IGNORECASE)  # warnings may come before


class NoCompiler(GantryTauError):
    """This machine has no C compiler for the platform "native"."""


def compile_libraries(
    sources: Mapping[str, str], platforms: Sequence[Platform], *, identifier: str, optimisation: str = "-O2"
) -> dict[Platform, bytes]:
    """The shared libraries of `fmu.c` for several platforms, compiled side by side.

    sources: file name -> text, with `fmu.c` among them; identifier: the model identifier; optimisation: "-O0"
    to "-O3". Only what the sources mark as visible is exported. The same sources give the same bytes.

    Raises NoCompiler if a native library is wanted and there is no compiler, ModelError if ziglang is needed
    and missing or if a compiler fails, with the first lines of what it says. Whatever ends it, compilers that
    still run are stopped and nothing is left on disk.
    """
    commands = {platform: compiler(platform) for platform in platforms}
    try:
        with tempfile.TemporaryDirectory(prefix="gantrytau-", ignore_cleanup_errors=True) as folder:
            _write(sources, Path(folder))
            for platform, command in commands.items():
                command += flags(platform, identifier, zig="ziglang" in command)
                command += [optimisation, UNIT, "-o", f"{platform.name}/{_OUTPUT}", "-lm"]
                (Path(folder) / platform.name).mkdir()
            return _run(commands, Path(folder), identifier)
    except OSError as error:
        raise ModelError(
            f"{identifier}: cannot be compiled ({error}), expected a compiler that starts and room in the folder "
            f"for temporary files '{tempfile.gettempdir()}'; the variables CC and TMPDIR name others"
        ) from error


def _write(sources: Mapping[str, str], folder: Path) -> None:
    for file, text in sources.items():
        target = folder / file
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text, encoding="utf-8", newline="\n")


def compiler(platform: Platform) -> list[str]:
    """The command of the compiler for a platform: CC, cc, gcc or clang if it is native, ziglang else.

    Raises NoCompiler or ModelError if there is none.
    """
    has_zig = importlib.util.find_spec("ziglang") is not None
    if platform.native:
        found = _compiler_of_this_machine()
        if found is None and not has_zig:
            raise NoCompiler(
                f"{platform.name}: no C compiler found, expected cc, gcc or clang on the PATH or the one that the "
                "variable CC names; install one (Debian, Ubuntu: apt install gcc libc6-dev), or "
                "pip install 'gantrytau[cross]'"
            )
        if found is not None:
            return found
    elif not has_zig:
        raise ModelError(
            f"{platform.name}: found no package ziglang, expected it for every platform but 'native'; "
            "pip install 'gantrytau[cross]', or take 'native' alone"
        )
    target = ["-target", platform.target] if platform.target else ["-mcpu=baseline"]
    return [sys.executable, "-m", "ziglang", "cc", *target]


def flags(platform: Platform, identifier: str, *, zig: bool) -> list[str]:
    """What the compiler is told besides optimisation and files; zig: whether it is zig's."""
    # a fused multiply-add would round differently from one processor to the next
    result = ["-std=c99", "-g0", "-shared", "-fvisibility=hidden", "-ffunction-sections", "-fdata-sections"]
    result += ["-fno-math-errno", "-ffp-contract=off"]
    # pairs of operations put together into vectors cost more than they save here: a tenth of the speed
    result += ["-fno-tree-vectorize", "-fno-tree-slp-vectorize"]
    if zig:
        result += ["-fno-sanitize=undefined"]  # zig's habit, which would need its runtime library
    else:
        result += ["-fcaller-saves"]  # values stay in registers across calls at -O1, too: 7 % of a step
    if platform.system == "windows":
        # GCC would link libgcc and winpthread as libraries, which other machines lack
        return [*result, "-s", *([] if zig else ["-static"])]
    if platform.system == "darwin":
        return [*result, "-fPIC", "-Wl,-x", "-Wl,-dead_strip", f"-Wl,-install_name,@rpath/{identifier}.dylib"]
    # nothing unwinds these frames on ELF systems (Windows needs the tables): a tenth of the file
    result += ["-fPIC", "-fno-asynchronous-unwind-tables"]
    return [*result, "-s", "-Wl,-Bsymbolic", "-Wl,--gc-sections", "-Wl,--no-undefined"]


def _compiler_of_this_machine() -> list[str] | None:
    command = c_compiler()
    if command is not None and not shutil.which(command[0]):
        named = os.environ["CC"].strip()
        raise NoCompiler(
            f"CC: found '{named}', expected a command on the PATH; correct or unset this variable"
        )
    return command


def _run(commands: Mapping[Platform, Sequence[str]], folder: Path, identifier: str) -> dict[Platform, bytes]:
    """What the compilers write, as many at a time as there are processors; the first failure ends all."""
    environment = _environment(folder, commands)
    waiting, running = list(commands), dict[Platform, subprocess.Popen[bytes]]()
    libraries: dict[Platform, bytes] = {}
    try:
        while waiting or running:
            while waiting and len(running) < (os.cpu_count() or 1):
                platform = waiting.pop(0)
                with uninterrupted():  # a compiler that is started is known, and so can be stopped
                    running[platform] = _start(commands[platform], folder, platform, environment)
            for platform, process in list(running.items()):
                if process.poll() is not None:
                    del running[platform]
                    code = process.returncode
                    libraries[platform] = _result(folder, platform, commands[platform], code, identifier)
            time.sleep(0.005)
    finally:
        for process in running.values():
            _stop(process)
    return {platform: libraries[platform] for platform in commands}


def _environment(folder: Path, commands: Mapping[Platform, Sequence[str]]) -> dict[str, str]:
    """Temporary files go where they vanish with the rest; only zig's system libraries are kept for next time."""
    environment = {**os.environ, **dict.fromkeys(("TMPDIR", "TMP", "TEMP"), str(folder))}
    environment["LC_ALL"] = "C"
    if any("ziglang" in command for command in commands.values()):
        environment["ZIG_LOCAL_CACHE_DIR"] = str(folder / "zig")
        environment["ZIG_GLOBAL_CACHE_DIR"] = str(_lasting_cache() or folder / "zig")
    return environment


def _lasting_cache() -> Path | None:
    """Where zig keeps its libraries, if it can be written to: zig would try without end where it cannot."""
    home = os.environ.get("LOCALAPPDATA" if os.name == "nt" else "XDG_CACHE_HOME")
    try:
        base = Path(home) if home else Path.home() / ".cache"
        cache = Path(os.environ.get("ZIG_GLOBAL_CACHE_DIR") or base / "zig")
        cache.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=cache):
            return cache
    except (OSError, RuntimeError):  # RuntimeError: no home folder
        return None


def _start(
    command: Sequence[str], folder: Path, platform: Platform, environment: Mapping[str, str]
) -> subprocess.Popen[bytes]:
    """A compiler in a process group of its own, so that it can be stopped with all that it starts."""
    with (folder / platform.name / _MESSAGES).open("wb") as messages:
        return subprocess.Popen(
            command,
            cwd=folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=messages,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )


def _stop(process: "subprocess.Popen[bytes]") -> None:
    """End a compiler and the programs that it started."""
    if os.name == "posix":
        # it may have ended by itself meanwhile, for which macOS has another error than Linux
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
    else:
        subprocess.run(["taskkill", "/F", "/T", "/PID", str(process.pid)], capture_output=True)
    process.wait()


def _result(folder: Path, platform: Platform, command: Sequence[str], code: int, identifier: str) -> bytes:
    """The library that a compiler has written, or an error that says why there is none."""
    library = folder / platform.name / _OUTPUT
    if code == 0 and library.is_file():
        return library.read_bytes()
    said = (folder / platform.name / _MESSAGES).read_text(encoding="utf-8", errors="replace").splitlines()
    said = [line.rstrip() for line in said if line.strip()]
    first = next((place for place, line in enumerate(said) if _FAILURE.search(line)), 0)
    words = "".join(f"\n  {line[:200]}" for line in said[first : first + 6]) or " it said nothing"
    ended = f"ended with signal {-code} (out of memory?)" if code < 0 else f"ended with code {code}"
    name = "ziglang" if "ziglang" in command else command[0]
    remedy = (
        "the C compiler must be GCC, Clang or MinGW with its headers; the variable CC names another one"
        if platform.native
        else "if the sources are the model's own, please report this"
    )
    raise ModelError(
        f"{identifier}: compiling for {platform.name}, '{name}' {ended}, expected a library:{words}\n{remedy}"
    )
