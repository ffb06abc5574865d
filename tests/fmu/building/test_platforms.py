"""Which platforms there are, and by which names."""

import platform
import sys

import pytest

from gantrytau import ModelError
from gantrytau_fmu import Build
from gantrytau_fmu.building.platforms import PLATFORMS, chosen, native


def names(platforms) -> list[str]:
    return [found.name for found in chosen(platforms)]


def test_all_are_six():
    assert names("all") == list(PLATFORMS)
    assert len(PLATFORMS) == 6
    assert not any(found.native for found in chosen("all"))


def test_names_aliases_and_their_order():
    assert names("win64") == ["x86_64-windows"]
    assert names(("aarch64-darwin", "linux64")) == ["x86_64-linux", "aarch64-darwin"]
    assert names("darwin64, aarch64-linux") == ["x86_64-darwin", "aarch64-linux"]
    assert names(("linux64", "x86_64-linux", "all")) == list(PLATFORMS)
    assert names(()) == []


@pytest.mark.parametrize(
    ("system", "machine", "name", "suffix"),
    [
        ("linux", "x86_64", "x86_64-linux", ".so"),
        ("linux", "aarch64", "aarch64-linux", ".so"),
        ("win32", "AMD64", "x86_64-windows", ".dll"),
        ("win32", "ARM64", "aarch64-windows", ".dll"),
        ("darwin", "arm64", "aarch64-darwin", ".dylib"),
        ("linux", "riscv64", "riscv64-linux", ".so"),
        ("freebsd14", "amd64", "x86_64-freebsd", ".so"),
    ],
)
def test_this_machine(monkeypatch, system, machine, name, suffix):
    monkeypatch.setattr(sys, "platform", system)
    monkeypatch.setattr(platform, "machine", lambda: machine)
    found = native()
    assert (found.name, found.suffix, found.native) == (name, suffix, True)
    assert bool(found.target) == (name in PLATFORMS)
    assert chosen("native") == (found,)


def test_a_platform_named_besides_native_is_built_as_the_named_one(monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(platform, "machine", lambda: "x86_64")
    assert chosen(("native", "linux64")) == chosen(("linux64", "native")) == (PLATFORMS["x86_64-linux"],)
    assert names(("native", "win64")) == ["x86_64-linux", "x86_64-windows"]


def test_an_unknown_platform_is_refused():
    with pytest.raises(ModelError, match=r"'Win64', expected 'native', .*; did you mean 'win64'") as refusal:
        Build(platforms=("native", "Win64"))
    assert refusal.value.argument == "platforms"
    with pytest.raises(ModelError, match="'5', expected"):
        chosen((5,))  # type: ignore[arg-type]
