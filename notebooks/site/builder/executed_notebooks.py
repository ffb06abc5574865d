"""Notebooks with their outputs. One is executed again when it has changed, or anything that it could call."""

import hashlib
import importlib
import os
import sys
import time
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any

from notebooks.site.builder.places import EXECUTED, NOTEBOOKS, PACKAGES, ROOT

LONGEST = 600.0  # s, for one cell
BUSY = 300.0  # s, for a kernel to begin, where much else is going on


def executed_notebooks(workers: int | None = None) -> dict[Path, Path]:
    """Sources of notebooks, and files of the same with outputs; RuntimeError with the cell that fails."""
    paths = sorted(NOTEBOOKS.glob("*.py"))
    EXECUTED.mkdir(parents=True, exist_ok=True)
    found = {path: EXECUTED / f"{path.stem}-{state(path.read_bytes())}.ipynb" for path in paths}
    missing = sorted((p for p, file in found.items() if not file.exists()), key=_duration, reverse=True)
    with ThreadPoolExecutor(workers or len(os.sched_getaffinity(0))) as pool:
        for done in [pool.submit(_execute, path, found[path]) for path in missing]:
            done.result()
    _clear(found.values())
    return found


def _execute(path: Path, target: Path) -> None:
    import jupytext
    import nbformat

    nbclient = importlib.import_module("nbclient")  # of the extra `docs`, where the type checker need not be

    begin = time.monotonic()
    notebook = jupytext.read(path)
    environment = os.environ | {"OMP_NUM_THREADS": "1", "PYTHONWARNINGS": "ignore", "GANTRYTAU_PROGRESS": "0"}
    environment["PYTHONPATH"] = os.pathsep.join([*_sources(), os.environ.get("PYTHONPATH", "")])
    quiet = ["--log-level=ERROR"]
    client: Any = nbclient.NotebookClient(
        notebook, timeout=LONGEST, startup_timeout=BUSY, kernel_name="python3", extra_arguments=quiet
    )
    try:
        client.execute(cwd=str(NOTEBOOKS), env=environment)
    except nbclient.exceptions.CellExecutionError as error:
        raise RuntimeError(f"{path.name}: a cell fails\n{error}") from None
    for number, cell in enumerate(notebook.cells):
        cell["id"] = f"cell-{number}"  # the same in every build
    nbformat.write(notebook, target)
    print(f"  {path.stem}: executed in {time.monotonic() - begin:.0f} s", file=sys.stderr, flush=True)


def _sources() -> Iterable[str]:
    return dict.fromkeys([str(ROOT), *(str(folder.parent) for folder in PACKAGES.values())])


def _duration(path: Path) -> int:
    """What comes first: long notebooks have long texts, as far as one can tell without running them."""
    return path.stat().st_size


def state(source: bytes) -> str:
    """A digest of a source and of all that it could call."""
    return hashlib.sha256(source + state_of_packages()).hexdigest()[:16]


@cache
def state_of_packages() -> bytes:
    """A digest of all files of the packages."""
    digest = hashlib.sha256(sys.version.encode())
    for folder in PACKAGES.values():
        for file in sorted(folder.rglob("*")):
            if file.suffix in (".py", ".toml", ".c", ".h", ".js", ".csv"):
                digest.update(str(file.relative_to(folder)).encode() + file.read_bytes())
    return digest.digest()


def _clear(kept: Iterable[Path]) -> None:
    for path in set(EXECUTED.glob("*.ipynb")) - set(kept):
        path.unlink()
