"""Trials of the extras: what each is there for, in small. Each says what it did, or raises."""

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from gantrytau.commands.doctor.essential_probes import PATIENCE, Wrong, expect

ELF, AARCH64 = b"\x7fELF", 183  # magic and machine of an object of Linux on ARM


def results() -> str:
    """A result is written as netCDF and as Parquet, and read again; it becomes a table of pandas."""
    import pyarrow.parquet
    import xarray

    from gantrytau import Result

    with tempfile.TemporaryDirectory(prefix="gantrytau-") as folder:
        file = Path(folder) / "result.nc"
        result = Result([0.0, 1.0], {"x": [1.0, 2.0]})
        result.save(file)
        with xarray.open_dataset(file, engine="h5netcdf") as found:
            expect("x as netCDF", float(found["x"][-1]), 2.0, 0.0)
        table = pyarrow.parquet.read_table(result.save(file.with_suffix(".parquet")))
        expect("x as Parquet", float(table["x"][-1].as_py()), 2.0, 0.0)
        expect("x in pandas", float(result.to_pandas()["x"].iloc[-1]), 2.0, 0.0)
    return "wrote and read netCDF and Parquet, made a table of pandas"


def view() -> str:
    """A page is made of a pendulum, and of a mesh in a file."""
    import trimesh

    from gantrytau import view as shown
    from gantrytau_models import Pendulum

    page = shown(Pendulum()).text
    if "<html" not in page.lower() or len(page) < 100_000:
        raise Wrong(f"the page of a pendulum has {len(page)} letters, expected viser's client in it")
    expect("the volume of a mesh", float(trimesh.creation.box((1.0, 2.0, 3.0)).volume), 6.0, 1e-9)
    return "made a page"


def cross() -> str:
    """A function is compiled for another processor, whatever this one is."""
    with tempfile.TemporaryDirectory(prefix="gantrytau-") as folder:
        source, target = Path(folder) / "tried.c", Path(folder) / "tried.o"
        source.write_text("double twice(double x) { return 2 * x; }\n")
        command = [sys.executable, "-m", "ziglang", "cc", "-target", "aarch64-linux", "-c"]
        found = subprocess.run(
            [*command, str(source), "-o", str(target)],
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            check=False,
        )
        if found.returncode:
            said = found.stderr.strip().splitlines()
            raise Wrong(f"zig fails: {said[-1] if said else f'exit code {found.returncode}'}")
        code = target.read_bytes()
    if not code.startswith(ELF) or int.from_bytes(code[18:20], "little") != AARCH64:
        raise Wrong("what zig wrote is no code for aarch64-linux")
    return "compiled for aarch64-linux"


def vision() -> str:
    """A chessboard is drawn, and its corners are found."""
    import cv2
    import numpy as np

    squares, size = 6, 20
    board = np.indices((squares, squares)).sum(axis=0) % 2
    image = np.full((squares * size + 40,) * 2, 255, np.uint8)
    image[20:-20, 20:-20] = np.kron(255 * (1 - board), np.ones((size, size))).astype(np.uint8)
    found, corners = cv2.findChessboardCorners(image, (squares - 1, squares - 1))
    if not found:
        raise Wrong("the corners of a chessboard were not found")
    expect("the first corner", float(np.min(corners)), 20.0 + size - 0.5, 1.0)
    return "found a chessboard"


def cluster() -> str:
    """A task runs on a cluster of one thread."""
    from dask.distributed import Client

    here: dict[str, Any] = dict(
        processes=False, n_workers=1, threads_per_worker=1, dashboard_address="127.0.0.1:0"
    )
    with Client(**here) as client:
        expect("the sum of 1 and 2", float(client.submit(sum, [1, 2]).result(timeout=PATIENCE)), 3.0, 0.0)
    return "ran a task"
