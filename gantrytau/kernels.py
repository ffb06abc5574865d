"""Functions of CasADi as machine code of this computer, kept in the user's cache: the same numbers, many times faster.

Where a kernel is not there yet, the function itself is used while a process of low priority compiles it for later calls; it
goes on when the caller's process ends. Run as a program, this file is that process. In the folder `kernels` of the cache:

    KEY-DIGEST.so   a kernel; KEY: hash of its function, the compiler and its flags; DIGEST: of its content
    KEY.work        a folder in which it is compiled: nobody else begins within RETRY
    KEY.failed      that folder where it failed: nobody begins anew within RETRY

The variable GANTRYTAU_CACHE names another folder for the cache; "off" stands for none. Without a compiler or a folder of the
user's own that can be written to, all functions remain as they are.
"""

from __future__ import annotations

import hashlib
import math
import os
import platform
import shlex
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import casadi as ca

VARIABLE = "GANTRYTAU_CACHE"
FLAGS = ("-fPIC", "-shared", "-ffp-contract=off")  # no sum is rounded otherwise than by CasADi
WORTH = 2e7  # instructions of all calls of a function, 0.1 s in CasADi's virtual machine: fewer are not worth a kernel
LEAST = 1000  # calls: to hash a function and to write it as C takes as long as 700
PATIENCE = 5  # times as many calls as are worth a kernel: after these one is made where no more are foretold
LOOK = 0.1  # s between two looks for a kernel
SMALL = 10_000  # instructions that -O1 compiles within a second
OFTEN = 1e5  # calls: -O1 takes six times as long to compile as -O0 and makes them three times as fast
MOST = 300_000  # instructions of a function: more take a compiler minutes
LONGEST = 300.0  # s, that it may take
RETRY = 3600.0  # s, after which what failed is tried again
LIMIT = 200_000_000  # bytes of all kernels: beyond it those that were not used for longest are deleted
PRIORITY = 15  # lower than that of other processes
LETTERS = 32  # of a hash
AT_ONCE = 8  # kernels that are compiled at the same time by all processes of a user
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")  # as CasADi asks for it


class Kernel:
    """A function that is called again and again: itself at first, its kernel from when there is one."""

    def __init__(
        self,
        function: ca.Function,
        instructions: float | None = None,
        level: str = "",
        priority: int = PRIORITY,
    ):
        """instructions: of one call, where functions in it are called repeatedly; level, priority: of the compiler."""
        self.function, self._priority = function, priority
        size = code_size(function)
        self._instructions = size if instructions is None else instructions
        quick = "-O1" if function.is_a("SXFunction") else "-O2"  # by a quarter, where there are loops
        self._level = level or (quick if size <= SMALL else "-O0")
        self.there = False
        self._calls = 0.0
        self._next = 0.0 if size <= MOST else math.inf  # look into the cache, s
        self._key, self._folder, self._command = "", Path(), [""]

    @property
    def awaited(self) -> bool:
        """Whether a kernel was looked for, was not there, and may be by now."""
        return 0.0 < self._next < math.inf

    def called(self, calls: float, ahead: float = 0.0, *, begin: bool = True, wait: bool = False) -> bool:
        """Count calls; whether `function` has become the kernel by this.

        ahead: calls that are expected besides; begin: whether a compiler begins where there is no kernel; wait: for it.
        """
        self._calls += calls
        expected = self._calls + ahead
        if expected * self._instructions < WORTH or expected < LEAST or time.monotonic() < self._next:
            return False
        begin = begin and (self._calls / PATIENCE + ahead) * self._instructions >= WORTH
        try:
            found = self._found(begin, wait)
        except (OSError, RuntimeError):  # no room or permission; CasADi cannot write this function as C
            self._next = math.inf
            return False
        if found is None:
            self._next = max(self._next, time.monotonic() + LOOK)
            return False
        self.function, self.there, self._next = found, True, math.inf
        return True

    def wait(self) -> bool:
        """Wait for the kernel, whoever compiles it; whether it is there."""
        working = True
        while working and not self.there and self._next < math.inf:
            time.sleep(max(self._next - time.monotonic(), 0.0))
            working = not self._key or (self._folder / f"{self._key}.work").exists()
            self.called(0.0, math.inf, wait=True)
        return self.there

    def _found(self, begin: bool, wait: bool) -> ca.Function | None:
        """The kernel of the cache. Without one, a process is started to compile it, unless another process does so."""
        if not self._key:
            command, folder = _command(self._level), kernel_folder()
            if command is None or folder is None:
                self._next = math.inf
                return None
            self._key, self._folder, self._command = _key(self.function.serialize(), command), folder, command
        found = _kept(self._folder, self._key, self.function)
        if found is None and begin:
            process = _begun(
                self._folder, self._key, lambda: _written(self.function), self._command, self._priority
            )
            if process is not None and wait:
                process.wait()
                found = _kept(self._folder, self._key, self.function)
            elif process is not None:  # whoever waits for it takes note of its end
                threading.Thread(target=process.wait, name="kernel", daemon=True).start()
        return found


def code_size(function: ca.Function) -> float:
    """The number of instructions of a function and of the functions it calls; inf if a called one lies in a library."""
    if function.class_name() == "External":
        return math.inf
    own = function.n_instructions() if function.is_a("SXFunction") or function.is_a("MXFunction") else 0
    return own + sum(code_size(called) for called in function.find_functions(0))


def kernel_for(function: ca.Function, calls: float, wait: bool = False) -> Kernel:
    """The kernel of a function, if compiling it pays. A missing kernel begins to be compiled in a process of its own.

    calls: how often it is expected to be called; wait: whether to wait for a compiler instead of going on without.
    """
    own = Kernel(function, level="-O1" if calls > OFTEN else "-O0")
    own.called(0.0, calls, wait=wait)
    return own


def kernel(function: ca.Function, calls: float, wait: bool = False) -> ca.Function:
    """The function compiled, where that pays, or the function itself; arguments of `kernel_for`."""
    return kernel_for(function, calls, wait).function


def library(source: str) -> Path | None:
    """The path of a shared library of C source, compiled unless it is in the cache; None without a compiler or a cache."""
    command, folder = _command("-O3"), kernel_folder()
    if command is None or folder is None:
        return None
    key = _key(source, command)
    with suppress(OSError):  # no room or permission
        if (found := _intact(folder, key)) is None and (
            process := _begun(folder, key, lambda: source, command, 0)
        ):
            process.wait()
            found = _intact(folder, key)
        return found
    return None


def c_compiler() -> list[str] | None:
    """The command of this machine's C compiler: what CC says, whether it is there or not, else cc, gcc or clang."""
    named = os.environ.get("CC", "").strip()
    if named:
        return [named] if shutil.which(named) else shlex.split(named, posix=os.name == "posix")
    return next(([name] for name in ("cc", "gcc", "clang") if shutil.which(name)), None)


def user_cache() -> Path:
    """Where programs keep files of this user that they can make again. RuntimeError if there is no home folder."""
    home = os.environ.get("LOCALAPPDATA" if os.name == "nt" else "XDG_CACHE_HOME")
    return Path(home) if home else Path.home() / ".cache"


def kernel_folder() -> Path | None:
    """Where kernels are kept; None if they shall not be, or if others could write there what this process would run."""
    named = os.environ.get(VARIABLE, "").strip()
    frozen = getattr(sys, "frozen", False)  # such a program has no Python that could run this file
    if named == "off" or frozen:
        return None
    folder = (Path(named) if named else user_cache() / "gantrytau") / "kernels"
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    if os.name == "posix":
        about = folder.stat()
        if about.st_uid != os.getuid() or about.st_mode & 0o022:
            return None
    return folder


def _command(level: str) -> list[str] | None:
    """What compiles, with its flags; None if there is no compiler."""
    command = c_compiler()
    found = shutil.which(command[0]) if command else None
    return [found, *command[1:], level, *FLAGS] if command and found else None


def _key(content: str, command: list[str]) -> str:
    """A hash of all that makes a kernel what it is."""
    import casadi as ca

    compiler = Path(command[0]).resolve()
    about = compiler.stat()
    parts = [
        ca.__version__,
        sys.platform,
        platform.machine(),
        str(compiler),
        about.st_size,
        about.st_mtime_ns,
    ]
    text = "\n".join([*map(str, parts), *command, content])
    return hashlib.sha256(text.encode()).hexdigest()[:LETTERS]


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:LETTERS]


def _intact(folder: Path, key: str) -> Path | None:
    """What was compiled for a key; what is damaged is deleted."""
    for path in folder.glob(f"{key}-*"):
        if _digest(path) == path.stem.partition("-")[2]:
            with suppress(OSError):  # a cache that cannot be written
                os.utime(path)
            return path
        path.unlink(missing_ok=True)
    return None


def _kept(folder: Path, key: str, function: ca.Function) -> ca.Function | None:
    """The kernel of a key; what this machine cannot load is deleted, and not made again for a while."""
    import casadi as ca

    path = _intact(folder, key)
    if path is None:
        return None
    try:
        found = ca.external(function.name(), str(path))
    except RuntimeError:
        with suppress(FileExistsError):
            (folder / f"{key}.failed").mkdir()
        path.unlink(missing_ok=True)
        return None
    return found


def _written(function: ca.Function) -> str:
    """A function as C; RuntimeError for one that CasADi cannot write."""
    import casadi as ca

    generator = ca.CodeGenerator("kernel.c")
    generator.add(function)
    return generator.dump()


def _begun(
    folder: Path, key: str, source: Callable[[], str], command: list[str], priority: int
) -> subprocess.Popen[bytes] | None:
    """The process that compiles a kernel; None where another one does, or too many are at work."""
    now = time.time()
    works, failed = list(folder.glob("*.work")), folder / f"{key}.failed"
    for other in (*works, failed):
        with suppress(FileNotFoundError):  # another process was quicker
            if now - other.stat().st_mtime > RETRY:
                shutil.rmtree(other, ignore_errors=True)
    work = folder / f"{key}.work"
    if len(works) >= AT_ONCE or failed.exists():
        return None
    try:
        work.mkdir()
    except FileExistsError:
        return None
    try:
        (work / "kernel.c").write_text(source())  # OSError on a full disk, where CasADi says nothing
    except (OSError, RuntimeError):
        _give_up(work)
        raise
    return subprocess.Popen(
        [sys.executable, "-I", "-S", __file__, str(work), str(priority), *command],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
        creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
    )


def _give_up(work: Path) -> None:
    """Leave a note that a kernel failed, without what takes room."""
    with suppress(OSError):
        work.rename(failed := work.with_suffix(".failed"))
        for path in failed.iterdir():
            path.unlink(missing_ok=True)


def compile_kernel(work: Path, priority: int, command: list[str]) -> None:
    """Compile `kernel.c` of a folder KEY.work and put the kernel beside it; the folder is deleted, or renamed KEY.failed."""
    if hasattr(os, "nice"):
        os.nice(priority)
    try:
        subprocess.run([*command, "kernel.c", "-o", "kernel", "-lm"], cwd=work, check=True, timeout=LONGEST)
        made, folder = work / "kernel", work.parent
        os.replace(made, folder / f"{work.stem}-{_digest(made)}{SUFFIX}")
    except (subprocess.SubprocessError, OSError) as error:
        _give_up(work)
        if isinstance(error, subprocess.TimeoutExpired) and os.name == "posix":
            os.killpg(0, signal.SIGKILL)  # this process and all that the compiler has begun
        return
    shutil.rmtree(work, ignore_errors=True)
    kernels = sorted(folder.glob(f"*-*{SUFFIX}"), key=lambda path: path.stat().st_mtime, reverse=True)
    size = 0
    for path in kernels:
        size += path.stat().st_size
        if size > LIMIT:
            path.unlink(missing_ok=True)


if __name__ == "__main__":
    compile_kernel(Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3:])
