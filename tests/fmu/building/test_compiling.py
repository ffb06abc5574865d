"""Compiling: what the libraries export and need, for this machine and for others, and how it fails."""

import contextlib
import ctypes
import os
import signal
import stat
import sys
import tempfile
import threading
import time
from pathlib import Path

import pytest

from gantrytau import GantryTauError, ModelError
from gantrytau_fmu.building.compile_libraries import NoCompiler, _lasting_cache, compile_libraries, compiler
from gantrytau_fmu.building.platforms import PLATFORMS, Platform, chosen, native
from tests.fmu.binaries_kept import libraries
from tests.fmu.building.binaries import exports, glibc_versions, imported_libraries, install_name

SOURCES = {
    "fmu.c": """
        #include "inner.h"
        #ifdef _WIN32
        #define SHOWN __declspec(dllexport)
        #else
        #define SHOWN __attribute__((visibility("default")))
        #endif
        double hidden(double x) { return half(x); }
        SHOWN const char *fmi2GetVersion(void) { return "2.0"; }
        SHOWN double fmi2Sine(double x) { return hidden(sin(x)) + pow(x, 3.5); }
        SHOWN double fmi2Rest(double a, double b, double c) { return a * b + c; }
    """,
    "inner.h": "#include <math.h>\nstatic double half(double x) { return x / 2; }\n",
}
EXPORTED = {"fmi2GetVersion", "fmi2Sine", "fmi2Rest"}


@pytest.fixture
def temporary_files(tmp_path, monkeypatch):
    """The folder in which compiling works, so that it can be looked into afterwards."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


@pytest.fixture
def no_path(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)


def library(sources: dict[str, str], platform: Platform | None = None, **options) -> bytes:
    """The library for one platform, by default this one."""
    wanted = platform or native()
    return compile_libraries(sources, (wanted,), identifier="small", **options)[wanted]


def fake_compiler(folder: Path, script: str) -> str:
    """A program that takes the place of a compiler."""
    if os.name != "posix":
        pytest.skip("shell scripts are compilers on POSIX only")
    program = folder / "compiler"
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    return str(program)


@pytest.fixture(scope="module")
def here() -> bytes:
    try:
        return library(SOURCES, optimisation="-O1")
    except NoCompiler:
        pytest.skip("no C compiler")


def loaded(library: bytes, folder: Path) -> ctypes.CDLL:
    path = folder / f"small{native().suffix}"
    path.write_bytes(library)
    found = ctypes.CDLL(str(path))
    found.fmi2Sine.argtypes, found.fmi2Sine.restype = [ctypes.c_double], ctypes.c_double
    found.fmi2Rest.argtypes, found.fmi2Rest.restype = [ctypes.c_double] * 3, ctypes.c_double
    found.fmi2GetVersion.restype = ctypes.c_char_p
    return found


def test_the_native_library_runs(here, tmp_path):
    library = loaded(here, tmp_path)
    assert library.fmi2GetVersion() == b"2.0"
    assert library.fmi2Sine(1.0) == pytest.approx(0.8414709848078965 / 2 + 1.0, rel=1e-15)  # a rounding
    # fused, the product would not be rounded: a^2 = 1 + 2^-26 + 2^-54, the last term is lost
    a = 1.0 + 2.0**-27
    assert library.fmi2Rest(a, a, -(1.0 + 2.0**-26)) == 0.0


def test_only_what_is_marked_is_exported(here):
    assert exports(here) == EXPORTED


def test_the_same_sources_give_the_same_bytes(here):
    again = library(SOURCES, optimisation="-O1")
    assert again == here


def test_nothing_is_left_after_success_or_failure(temporary_files, here):
    library(SOURCES, optimisation="-O0")
    with pytest.raises(ModelError):
        library({"fmu.c": "nonsense"})
    assert list(temporary_files.iterdir()) == []


def test_an_error_in_the_sources_is_shown(here):
    wrong = SOURCES | {"inner.h": "#warning first a warning\nstatic double half(double x) { return y; }\n"}
    with pytest.raises(ModelError, match=r"(?s)small: compiling for .*ended with code 1, expected") as found:
        library(wrong)
    assert "inner.h:2" in str(found.value)
    assert "first a warning" not in str(found.value)
    assert "the variable CC names another one" in str(found.value)


def test_a_symbol_that_exists_nowhere_is_an_error_now_and_not_when_loading(here):
    unit = SOURCES["fmu.c"].replace("double hidden", "double gone(double);\ndouble hidden")
    missing = SOURCES | {"fmu.c": unit.replace("half(x)", "gone(x)")}
    with pytest.raises(ModelError, match="gone"):
        library(missing)


def test_without_a_compiler_it_is_said(no_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ziglang", None)
    with pytest.raises(NoCompiler, match=r"no C compiler found, expected cc, gcc or clang"):
        library(SOURCES)
    assert issubclass(NoCompiler, GantryTauError)
    assert not issubclass(NoCompiler, ModelError)  # so that an export can go on without binaries


def test_the_variable_names_the_compiler(monkeypatch):
    monkeypatch.setenv("CC", f"'{sys.executable}' -c pass")
    assert compiler(native()) == [sys.executable, "-c", "pass"]
    monkeypatch.setenv("CC", "no-such-compiler -m64")
    with pytest.raises(NoCompiler, match="CC: found 'no-such-compiler -m64', expected a command on the PATH"):
        compiler(native())


def test_other_platforms_need_ziglang(monkeypatch):
    monkeypatch.setitem(sys.modules, "ziglang", None)
    with pytest.raises(ModelError, match=r"aarch64-windows: found no package ziglang.*'gantrytau\[cross\]'"):
        library(SOURCES, PLATFORMS["aarch64-windows"])


def test_a_compiler_that_is_killed_or_writes_nothing_is_an_error(monkeypatch, tmp_path):
    monkeypatch.setenv("CC", fake_compiler(tmp_path, "kill -9 $$"))
    with pytest.raises(ModelError, match=r"ended with signal 9 \(out of memory\?\)"):
        library(SOURCES)
    monkeypatch.setenv("CC", fake_compiler(tmp_path, "exit 0"))
    with pytest.raises(ModelError, match="ended with code 0, expected a library: it said nothing"):
        library(SOURCES)


def test_a_compiler_that_cannot_start_is_an_error(monkeypatch, tmp_path):
    program = Path(fake_compiler(tmp_path, ""))
    program.write_bytes(b"\x7fELF, but no more")
    monkeypatch.setenv("CC", str(program))
    with pytest.raises(ModelError, match=r"small: cannot be compiled .*the variables CC and TMPDIR name"):
        library(SOURCES)


@pytest.mark.skipif(os.name != "posix", reason="signals to oneself are POSIX")
def test_an_interruption_stops_the_compiler_and_cleans_up(monkeypatch, tmp_path, temporary_files):
    """The compiler starts a program of its own, as GCC does; both must be gone."""
    written = tmp_path.parent / f"{tmp_path.name}-processes"
    script = f"sleep 3600 & echo $$ $! > '{written}'; wait"
    program = fake_compiler(written.parent, script)
    monkeypatch.setenv("CC", program)
    threading.Thread(target=_interrupt_once_written, args=(written,)).start()
    with pytest.raises(KeyboardInterrupt):
        library(SOURCES)
    assert not any(alive(int(process)) for process in written.read_text().split())
    assert list(temporary_files.iterdir()) == []


def _interrupt_once_written(path: Path) -> None:
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and not (path.exists() and path.read_text().endswith("\n")):
        time.sleep(0.01)
    os.kill(os.getpid(), signal.SIGINT)


def alive(process: int) -> bool:
    """Whether a process runs; one that ended but was not yet waited for does not."""
    for _ in range(3_000):  # a killed grandchild vanishes when the system has time
        with contextlib.suppress(ProcessLookupError, FileNotFoundError):
            os.kill(process, 0)
            state = Path(f"/proc/{process}/stat")
            if not state.exists() or state.read_text().rsplit(")", 1)[1].split()[0] != "Z":
                time.sleep(0.02)
                continue
        return False
    return True


def test_the_first_failure_stops_the_others(monkeypatch, tmp_path):
    """One compiler fails at once, the other would take an hour."""
    failing = fake_compiler(tmp_path, 'case "$*" in *slow*) sleep 3600;; *) echo "error: no"; exit 3;; esac')
    monkeypatch.setattr("gantrytau_fmu.building.compile_libraries.compiler", lambda platform: [failing])
    platforms = [Platform(name, "", ".so", name) for name in ("slow-linux", "quick-linux")]
    with pytest.raises(ModelError, match=r"quick-linux.*ended with code 3"):
        compile_libraries(SOURCES, platforms, identifier="small")


def test_zig_keeps_its_libraries_where_it_may_write(monkeypatch, tmp_path):
    monkeypatch.delenv("ZIG_GLOBAL_CACHE_DIR", raising=False)
    variable = "LOCALAPPDATA" if os.name == "nt" else "XDG_CACHE_HOME"
    monkeypatch.setenv(variable, str(tmp_path / "cache"))
    assert _lasting_cache() == tmp_path / "cache" / "zig"
    (tmp_path / "file").touch()
    monkeypatch.setenv(variable, str(tmp_path / "file"))  # nothing can be created below a file
    assert _lasting_cache() is None


@pytest.fixture(scope="module")
def everywhere() -> dict[str, bytes]:
    pytest.importorskip("ziglang", reason="the extra 'cross' is not installed")
    found = libraries(SOURCES, chosen("all"), identifier="small", optimisation="-O1")
    return {platform.name: library for platform, library in found.items()}


def test_every_platform_exports_the_same(everywhere):
    assert list(everywhere) == list(PLATFORMS)
    assert {name: exports(library) for name, library in everywhere.items()} == dict.fromkeys(
        PLATFORMS, EXPORTED
    )


def test_no_library_needs_more_than_the_system_has(everywhere):
    for name, library in everywhere.items():
        needed = imported_libraries(library)
        if "linux" in name:
            assert needed <= {"libc.so.6", "libm.so.6"}
            assert max(glibc_versions(library)) <= (2, 17)
        elif "windows" in name:
            # the universal C runtime, part of Windows since 10
            assert all(file == "KERNEL32.dll" or file.startswith("api-ms-win-crt-") for file in needed)
        else:
            assert needed == {"/usr/lib/libSystem.B.dylib"}
            assert install_name(library) == "@rpath/small.dylib"


def test_the_cross_compiled_library_runs_here(everywhere, tmp_path):
    if native().name not in everywhere:
        pytest.skip("none of the six platforms")
    assert loaded(everywhere[native().name], tmp_path).fmi2Sine(0.0) == 0.0
