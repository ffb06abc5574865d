"""Extras tell the truth: what they install is used, what is used is installed, and what is missing is told in words."""

import ast
import importlib.metadata
import re
import subprocess
import sys
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from gantrytau import GantryTauError, Result, study, view
from gantrytau.commands.arguments.saved_results import read_result
from gantrytau.viewing import MeshFile
from gantrytau_fmu import Build, export_fmu
from gantrytau_models import Pendulum
from gantrytau_optimica.vision.opencv import opencv

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PACKAGES = [
    ROOT / "gantrytau",
    *(ROOT / name / f"gantrytau_{name}" for name in ("models", "optimica", "fmu")),
]
OWN = {"gantrytau", "gantrytau_models", "gantrytau_optimica", "gantrytau_fmu"}
FOR_USERS = ("results", "view", "cross", "vision", "cluster")
# of distributions of `bench`, which are not installed everywhere, or install only a path
MODULES = {"do-mpc": {"do_mpc"}, "pin": {"pinocchio"}, "pythonfmu": {"pythonfmu"}, "rockit-meco": {"rockit"}}
PROGRAMS = {  # used by name, not imported
    "basedpyright": "Makefile",
    "ruff": "Makefile",
    "pytest-xdist": "Makefile",
    "furo": "notebooks/site/conf.py",
    "hatch-fancy-pypi-readme": "pyproject.toml",
    "hatchling": "tests/test_distribution.py",
    "ipykernel": "Makefile",
    "myst-nb": "notebooks/site/conf.py",
    "sphinx": "Makefile",
    "twine": "tests/test_distribution.py",
    "ziglang": "fmu/gantrytau_fmu/building/compile_libraries.py",
}
HOSTS = {"IPython"}  # imported where it runs already, to show something in it
LOADED = {"tbb": "ecospy"}  # a library that another distribution loads: named in pyproject.toml as such


def requirements(texts):
    """The distributions of a list, without those of this project."""
    return {canonicalize_name(Requirement(text).name) for text in texts} - {"gantrytau"}


DEPENDENCIES = requirements(PROJECT["dependencies"])
EXTRAS = {name: requirements(texts) for name, texts in PROJECT["optional-dependencies"].items()}


@cache
def owners():
    """Top module -> the distributions that install it."""
    return importlib.metadata.packages_distributions()


def modules_of(distribution):
    """The top modules that a distribution installs."""
    found = {module for module, names in owners().items() if distribution in map(canonicalize_name, names)}
    return MODULES.get(distribution, found)


def imported(folders):
    """Modules that files import, late and by `import_module` too: dotted name -> files."""
    found: dict[str, set[str]] = {}
    for folder in folders:
        for file in sorted(folder.rglob("*.py")):
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
                names = []
                if isinstance(node, ast.Import):
                    names = [alias.name for alias in node.names]
                elif isinstance(node, ast.ImportFrom) and not node.level:
                    names = [str(node.module), *(f"{node.module}.{alias.name}" for alias in node.names)]
                elif isinstance(node, ast.Call) and ast.unparse(node.func).rpartition(".")[2] in (
                    "import_module",
                    "importorskip",
                    "extra_module",
                ):
                    first = next(
                        (part for a in node.args for part in ast.walk(a) if isinstance(part, ast.Constant)),
                        None,
                    )
                    names = [first.value] if first is not None and isinstance(first.value, str) else []
                for name in (one for one in names if one.partition(".")[0]):
                    found.setdefault(name, set()).add(str(file.relative_to(ROOT)))
    return found


@pytest.fixture(scope="module")
def used():
    return imported(PACKAGES)


@pytest.fixture(scope="module")
def used_by_tests():
    return imported([ROOT / "tests", ROOT / "notebooks"])


def is_used(distribution, names):
    tops = {name.partition(".")[0] for name in names}
    aliases = {"distributed"} if any(name.startswith("dask.distributed") for name in names) else set()
    return bool(modules_of(distribution) & (tops | aliases))


PAIRS = [(extra, name) for extra, names in EXTRAS.items() for name in sorted(names)]


@pytest.mark.parametrize(("extra", "distribution"), PAIRS, ids=[f"{extra}-{name}" for extra, name in PAIRS])
def test_what_an_extra_installs_is_used(extra, distribution, used, used_by_tests):
    if distribution in PROGRAMS:
        text = (ROOT / PROGRAMS[distribution]).read_text(encoding="utf-8")
        words = {
            "pytest-xdist": "-n auto",
            "myst-nb": "myst_nb",
            "sphinx": "docs",
            "ipykernel": "docs",
            "hatch-fancy-pypi-readme": "hooks.fancy-pypi-readme",
        }  # it builds pages
        assert words.get(str(distribution), str(distribution)) in text
        return
    distribution = LOADED.get(distribution, distribution)
    if not modules_of(distribution):
        pytest.skip(f"{distribution} is not installed")
    names = used if extra in FOR_USERS else used | used_by_tests
    assert is_used(distribution, names), f"{extra}: no file imports {distribution}"


@pytest.mark.parametrize("distribution", sorted(DEPENDENCIES))
def test_what_is_required_is_used(distribution, used):
    assert is_used(distribution, used), f"no file imports {distribution}"


def test_what_is_used_is_installed_by_the_project(used):
    """What only comes along with something else may stay away with its next version."""
    known = DEPENDENCIES.union(*(EXTRAS[extra] for extra in FOR_USERS))
    tops: dict[str, set[str]] = {}
    for name, files in used.items():
        tops.setdefault(name.partition(".")[0], set()).update(files)
    strangers = {
        name: sorted(files)
        for name, files in tops.items()
        if name not in sys.stdlib_module_names | OWN | HOSTS
        and not known & {canonicalize_name(owner) for owner in owners().get(name, ())}
    }
    assert strangers == {}


def test_what_is_used_of_an_extra_is_imported_late(used):
    """`import gantrytau` and its neighbours bring no module of an extra along."""
    modules = {module for extra in FOR_USERS for name in EXTRAS[extra] for module in modules_of(name)}
    code = f"import sys, {', '.join(sorted(OWN))}, gantrytau_optimica.vision; print(*sys.modules)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert modules & set(found.stdout.split()) == set()


NETCDF = "results", lambda: Result([0.0, 1.0], {"x": [1.0, 2.0]}).save("a.nc")
STUDY = "results", lambda: study(size, over={"x": [1.0]}).save("a.nc")
READ = "results", lambda: read_result(Path("a.nc"))
CLUSTER = "cluster", lambda: study(size, over={"x": [1.0]}, where="dask")
WITHOUT = [  # module that is missing, the extra that has it, and a call that needs it
    ("xarray", *NETCDF),
    ("h5netcdf", *NETCDF),
    ("h5py", *NETCDF),
    ("xarray", *STUDY),
    ("h5netcdf", *STUDY),
    ("h5py", *STUDY),
    ("xarray", *READ),
    ("h5netcdf", *READ),
    ("pandas", "results", lambda: Result([0.0, 1.0], {"x": [1.0, 2.0]}).to_pandas()),
    ("pandas", "results", lambda: study(size, over={"x": [1.0]}).to_pandas()),
    ("pyarrow", "results", lambda: Result([0.0, 1.0], {"x": [1.0, 2.0]}).save("a.parquet")),
    ("viser", "view", lambda: view(Pendulum())),
    ("trimesh", "view", lambda: view(Meshed())),
    ("dask", *CLUSTER),
    ("distributed", *CLUSTER),
    ("cv2", "vision", opencv),
    ("ziglang", "cross", lambda: export_fmu(Pendulum(), "a.fmu", build=Build(platforms=("aarch64-linux",)))),
]


class Meshed(Pendulum):
    """A pendulum that is seen as a mesh of its own."""

    def shapes(self) -> Any:
        yield MeshFile(file="plate.stl", at=("x", 0.0, "y"))


def size(x):
    return abs(x)


@pytest.mark.parametrize(
    ("module", "extra", "call"), WITHOUT, ids=[f"{m}-{k}" for k, (m, *_) in enumerate(WITHOUT)]
)
def test_what_is_missing_is_told_with_its_extra(module, extra, call, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for file in ("plate.stl", "a.nc"):
        Path(file).write_text("solid a\nendsolid a\n")
    also = {"distributed": ("distributed", "dask.distributed")}.get(module, (module,))
    for name in [*sys.modules, module]:
        if any(f"{name}.".startswith(f"{one}.") for one in also):
            monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(GantryTauError) as told:
        call()
    assert f"pip install 'gantrytau[{extra}]'" in str(told.value)


def test_opencv_is_imported_at_one_place(used):
    assert used["cv2"] == {"optimica/gantrytau_optimica/vision/opencv.py"}


def test_every_module_of_an_extra_is_missed_by_a_call():
    assert {extra for _, extra, _ in WITHOUT} == set(FOR_USERS)
    modules = {module for extra in FOR_USERS for name in EXTRAS[extra] for module in modules_of(name)}
    assert {module for module, _, _ in WITHOUT} >= {
        m for m in modules if not re.match("_|examples|tests?$", m)
    }
