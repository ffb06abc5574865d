"""`import gantrytau` stays quick because it leaves alone what takes long to load."""

import subprocess
import sys

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
    code = "import sys, gantrytau; print(*[name for name in sys.modules if name.startswith('scipy')])"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.split() == []


@pytest.mark.parametrize("package", ["gantrytau", "gantrytau_models", "gantrytau_optimica"])
def test_import_leaves_heavy_modules_alone(package):
    code = f"import sys, {package}; print(*[name for name in {HEAVY} if name in sys.modules])"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.split() == []
