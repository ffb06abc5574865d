"""What goes to PyPI: built, checked, and installed into an empty environment. Twelve seconds, most of them pip's."""

import email
import importlib.metadata
import re
import subprocess
import sys
import sysconfig
import tarfile
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("gantrytau", "gantrytau_models", "gantrytau_optimica", "gantrytau_fmu")


def called(*command, folder=ROOT) -> str:
    done = subprocess.run([*map(str, command)], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> Path:
    """A folder with the sdist, and the wheel that is built from it as pip would."""
    folder = tmp_path_factory.mktemp("dist")
    called(sys.executable, "-m", "hatchling", "build", "-t", "sdist", "-d", folder)
    (sdist,) = folder.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        archive.extractall(folder / "unpacked", filter="data")
    (sources,) = (folder / "unpacked").iterdir()
    called(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder, folder=sources)
    return folder


def test_pypi_takes_them(built):
    called(sys.executable, "-m", "twine", "check", "--strict", *built.glob("gantrytau-*.*"))


def test_the_page_has_no_links_into_the_repository(built):
    (wheel,) = built.glob("*.whl")
    (found,) = importlib.metadata.distributions(path=[str(wheel)])
    metadata = email.message_from_string(found.read_text("METADATA") or "")
    page = str(metadata.get_payload())
    links = re.findall(r"\]\(([^)]+)\)", page)
    assert len(links) > 10
    assert [link for link in links if not link.startswith("https://")] == []
    assert {line.partition(",")[0] for line in metadata.get_all("Project-URL", [])} >= {"Homepage", "Issues"}


def test_the_sources_bring_what_explains_them(built):
    (sources,) = (built / "unpacked").iterdir()
    there = {path.name for path in sources.iterdir()}
    assert there >= {
        "README.md",
        "CHANGELOG.md",
        "CONTRIBUTING.md",
        "CITATION.cff",
        "LICENSE",
        "pyproject.toml",
    }


def test_the_wheel_works_in_an_empty_environment(built, tmp_path):
    """What it needs is found where this Python finds it, the package itself only in the environment."""
    venv.create(tmp_path / "empty", with_pip=False, symlinks=True)
    python = tmp_path / "empty" / "bin" / "python"
    place = Path(
        called(
            python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", folder=tmp_path
        ).strip()
    )
    (wheel,) = built.glob("*.whl")
    called(sys.executable, "-m", "pip", "--python", python, "install", "--no-index", "--no-deps", "-q", wheel)
    (place / "needed.pth").write_text(f"{sysconfig.get_path('purelib')}\n")  # its own .pth files are not read
    code = f"import {', '.join(PACKAGES)}; print(*({', '.join(f'{name}.__file__' for name in PACKAGES)},), sep='\\n')"
    for file in called(python, "-c", code, folder=tmp_path).split():
        assert Path(file).is_relative_to(place)
    assert "GantryTau" in called(tmp_path / "empty" / "bin" / "gantrytau", "library", folder=tmp_path)
