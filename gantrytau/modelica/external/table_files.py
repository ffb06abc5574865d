"""Matrices of table files: text with `double name(2,3)`, MAT files of version 4 to 7, comma-separated values."""

import re
from functools import lru_cache
from importlib import import_module
from pathlib import Path

import numpy as np

from gantrytau.border.refusal import ModelError, did_you_mean

HEAD = re.compile(r"^\s*(?:double|float)\s+([^\s(]+)\s*\(\s*(\d+)\s*,\s*(\d+)\s*\)", re.MULTILINE)


def table_of_file(path: str, name: str, delimiter: str, header_lines: int) -> np.ndarray:
    """The matrix of that name; ModelError with the file where there is none."""
    file = Path(path)
    if not file.is_file():
        raise ModelError("found no file of a table, expected one", place=path)
    return _read(file, name, delimiter, header_lines, file.stat().st_mtime_ns)


@lru_cache(maxsize=32)
def _read(file: Path, name: str, delimiter: str, header_lines: int, _changed: int) -> np.ndarray:
    try:
        if file.suffix.lower() == ".csv":
            return np.loadtxt(file, delimiter=delimiter, skiprows=header_lines, ndmin=2, encoding="utf-8-sig")
        return _of_mat(file, name) if file.suffix.lower() == ".mat" else _of_text(file, name)
    except (ValueError, OSError, NotImplementedError) as error:
        raise ModelError(f"found no matrix '{name}' that can be read: {error}", place=str(file)) from error


def _of_mat(file: Path, name: str) -> np.ndarray:
    """The matrix of a name, or of a name in a structure, `s.name`."""
    first, *members = name.split(".")
    held = import_module("scipy.io").loadmat(file, variable_names=[first])
    for known in (first, *members):
        if known not in (held if isinstance(held, dict) else held.dtype.names or ()):
            raise ModelError(f"found no matrix '{name}', expected one", place=str(file))
        held = held[known] if isinstance(held, dict) else held[known][0, 0]
    return np.array(held, float)


def _of_text(file: Path, name: str) -> np.ndarray:
    """Numbers behind their head, separated by blanks, tabs, commas or semicolons; comments begin with '#'."""
    text = file.read_text(encoding="utf-8-sig")
    heads = {found[1]: found for found in HEAD.finditer(text)}
    if not text.startswith("#1"):
        raise ModelError("found no '#1' in the first line, expected it in a file of tables", place=str(file))
    if name not in heads:
        raise ModelError(f"found no matrix '{name}'{did_you_mean(name, heads)}", place=str(file))
    shape = int(heads[name][2]), int(heads[name][3])
    rest = re.sub(r"#.*", "", text[heads[name].end() :])
    words = re.split(r"[\s,;]+", rest.strip(), maxsplit=shape[0] * shape[1])[: shape[0] * shape[1]]
    return np.array([float(word) for word in words]).reshape(shape)
