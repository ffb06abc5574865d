"""Kernels: the same numbers as CasADi's virtual machine, kept from one process to the next, whatever the cache is like."""

import os
import subprocess
import sys
import time

import casadi as ca
import numpy as np
import pytest

from gantrytau import kernels
from gantrytau.kernels import Kernel, c_compiler, kernel

CALLS = 1e9
compiling = pytest.mark.skipif(c_compiler() is None, reason="no C compiler")
TWO_PROCESSES = """
import casadi as ca
from gantrytau.kernels import kernel
x = ca.SX.sym("x", 2)
kernel(ca.Function("tiny", [x], [ca.sin(x[0]) * x[1]]), 1e9, wait=True)
"""
FULL_DISK = """
import resource, sys
import casadi as ca
from gantrytau.kernels import kernel
x = ca.SX.sym("x", 2)
function = ca.Function("tiny", [x], [ca.sin(x[0]) * x[1]])
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), int(sys.argv[1])))
assert kernel(function, 1e9, wait=True) is function
"""


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("GANTRYTAU_CACHE", str(tmp_path))
    return tmp_path / "kernels"


def tiny() -> ca.Function:
    x = ca.SX.sym("x", 2)
    return ca.Function("tiny", [x], [ca.sin(x[0]) * x[1]])


def compiled() -> ca.Function:
    return kernel(tiny(), CALLS, wait=True)


def same(found: ca.Function) -> bool:
    x = np.random.default_rng(0).uniform(-9, 9, (2, 50))
    return np.array_equal(np.array(found.map(50)(x)), np.array(tiny().map(50)(x)))


def is_kernel(found: ca.Function) -> bool:
    return found.class_name() == "External"


@compiling
def test_the_same_numbers_kept_for_later(cache):
    assert is_kernel(compiled())
    assert same(compiled())
    (kept,) = cache.iterdir()
    before = kept.stat().st_ino
    assert is_kernel(kernel(tiny(), CALLS))
    assert [one.stat().st_ino for one in cache.iterdir()] == [before]


@compiling
def test_the_virtual_machine_until_it_is_there(cache):
    assert not is_kernel(kernel(tiny(), CALLS))
    end = time.monotonic() + 30
    while time.monotonic() < end and not is_kernel(kernel(tiny(), CALLS)):
        time.sleep(0.02)
    assert is_kernel(kernel(tiny(), CALLS))


@compiling
def test_a_damaged_kernel_is_made_again(cache):
    compiled()
    (kept,) = cache.iterdir()
    kept.write_bytes(kept.read_bytes()[:100])
    assert not is_kernel(kernel(tiny(), 1.0))
    assert is_kernel(compiled())
    assert same(compiled())


@compiling
def test_what_cannot_be_loaded_is_not_made_again_and_again(cache):
    compiled()
    (kept,) = cache.iterdir()
    kept.write_bytes(b"of another machine")
    kept.rename(kept.with_stem(f"{kept.stem.partition('-')[0]}-{kernels._digest(kept)}"))
    assert not is_kernel(compiled())
    assert [one.suffix for one in cache.iterdir()] == [".failed"]


@compiling
def test_two_processes_at_once(cache):
    both = [subprocess.Popen([sys.executable, "-c", TWO_PROCESSES]) for _ in range(2)]
    assert [one.wait(60) for one in both] == [0, 0]
    assert is_kernel(compiled())
    assert len(list(cache.iterdir())) == 1


@compiling
@pytest.mark.skipif(sys.platform == "win32", reason="limits of POSIX")
@pytest.mark.parametrize("size", [1000, 10_000])  # bytes: too few for the C source, and for the kernel
def test_a_full_disk(cache, size):
    found = subprocess.run([sys.executable, "-c", FULL_DISK, str(size)], capture_output=True, check=True)
    assert not found.stdout + found.stderr
    assert not is_kernel(compiled())
    (note,) = cache.iterdir()
    assert note.suffix == ".failed"
    assert not list(note.iterdir())
    os.utime(note, (1, 1))
    assert is_kernel(compiled())
    assert same(compiled())


@compiling
def test_in_a_loop_from_when_it_is_there(cache):
    own = Kernel(tiny())
    few = 2 * kernels.WORTH / tiny().n_instructions()
    assert not own.called(few)
    assert not cache.exists() or not list(cache.iterdir())
    assert not own.called(kernels.PATIENCE * few)
    end = time.monotonic() + 30
    while time.monotonic() < end and not own.called(1):
        time.sleep(0.02)
    assert is_kernel(own.function)
    assert Kernel(tiny()).called(few)


@compiling
def test_a_cache_for_reading_only(cache):
    compiled()
    cache.chmod(0o500)
    assert is_kernel(kernel(tiny(), CALLS))


@compiling
def test_the_oldest_are_deleted(cache, monkeypatch):
    cache.mkdir(mode=0o700)
    old, unused = cache / "0-0.so", cache / "1.work"
    old.write_bytes(bytes(10))
    os.truncate(old, kernels.LIMIT)  # a hole takes no room
    os.utime(old, (1, 1))
    unused.mkdir()
    os.utime(unused, (1, 1))
    assert is_kernel(compiled())
    assert not old.exists()
    assert not unused.exists()


@pytest.mark.parametrize("trouble", ["off", "no compiler", "wrong compiler", "a file", "others may write"])
def test_whatever_fails_the_function_stays(cache, monkeypatch, trouble):
    match trouble:
        case "off":
            monkeypatch.setenv("GANTRYTAU_CACHE", "off")
        case "no compiler":
            monkeypatch.delenv("CC", raising=False)
            monkeypatch.setenv("PATH", "")
        case "wrong compiler":
            monkeypatch.setenv("CC", sys.executable)
        case "a file":
            cache.write_text("no folder")
        case "others may write":
            if os.name != "posix":
                pytest.skip("permissions of POSIX")
            cache.mkdir()
            cache.chmod(0o777)
    assert not is_kernel(compiled())
    assert same(compiled())


@compiling
def test_what_calls_a_library_is_left(cache):
    x = ca.SX.sym("x", 2)
    function = ca.Function("outer", [x], [compiled()(x) + 1])
    assert kernel(function, CALLS, wait=True) is function


def test_what_does_not_pay_is_left(cache):
    function = tiny()
    assert kernel(function, 1.0) is function
    assert not cache.exists()
