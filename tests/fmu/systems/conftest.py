"""Small FMUs, and the two coupled masses."""

import tempfile

import pytest

from tests.fmu.systems.coupled_masses import first, second
from tests.fmu.systems.small_fmus import Builder


@pytest.fixture(scope="module")
def build(tmp_path_factory):
    """Small FMUs, each made once in a file of tests."""
    return Builder(tmp_path_factory.mktemp("fmus"))


@pytest.fixture(scope="module")
def halves(build):
    """The two masses; they are joined by WIRES."""
    return {"a": first(build), "b": second(build)}


@pytest.fixture
def nothing_stays_behind(tmp_path, monkeypatch):
    """No folder of an unpacked FMU survives, however a simulation ends."""
    place = tmp_path / "unpacked here"
    place.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(place))
    yield
    assert not list(place.glob("cosimulation-*"))
