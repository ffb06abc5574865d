"""All public names load quickly because they leave alone what takes long, and a package loads those asked for."""

import subprocess
import sys
from importlib import import_module

import pytest

# Loaded by the functions that need them. Counting modules, not seconds, answers the same on every machine.
HEAVY = [
    "matplotlib",
    "xarray",
    "pandas",
    "h5netcdf",
    "pyarrow",
    "fmpy",
    "typer",
    "rich",
    "IPython",
    "viser",
    "trimesh",
    "scipy.optimize",
    "scipy.io",
    "scipy.integrate",
    "scipy.interpolate",
    "cv2",
]


def test_the_language_leaves_all_of_scipy_alone():
    code = "import sys; from gantrytau import *; print(*[name for name in sys.modules if name.startswith('scipy')])"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.split() == []


def test_a_package_loads_what_is_asked_for():
    code = "import sys, gantrytau, gantrytau_models; gantrytau.Model; print(*sys.modules)"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(answer.stdout.split())
    assert "gantrytau.language.model" in loaded
    assert not loaded & {"gantrytau.simulation.simulate", "gantrytau_models.mechanisms.delta"}


@pytest.mark.parametrize("package", ["gantrytau", "gantrytau_models"])
def test_every_public_name_is_found_and_listed(package):
    module = import_module(package)
    assert {name for name in module.__all__ if not hasattr(module, name)} == set()
    assert {*module.__all__} <= {*dir(module)}
    with pytest.raises(AttributeError, match=f"module '{package}' has no attribute 'simulat'"):
        getattr(module, "simulat")  # noqa: B009


@pytest.mark.parametrize("package", ["gantrytau", "gantrytau_models", "gantrytau_optimica"])
def test_import_leaves_heavy_modules_alone(package):
    code = f"import sys; from {package} import *; print(*[name for name in {HEAVY} if name in sys.modules])"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.split() == []
