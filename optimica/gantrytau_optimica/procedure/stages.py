"""Stages of a long procedure, kept on file: what was finished, and for which question, is not computed again.

A stage is a frozen record; it is written whole or not at all, with a digest of everything that it depends on. Found with
another digest, or not readable, it is made anew.
"""

import json
import zipfile
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from gantrytau.ensembles import digests
from gantrytau.whole_files import replacing

Record = TypeVar("Record")
VERSION = "4"  # of what the stages compute; another one makes all anew
Progress = Callable[[str, int, int], None]


def digest(*things: Any) -> str:
    """One number for arrays, records, numbers and words, alike for alike ones on every run."""
    return digests.digest(VERSION, things)


class Stages:
    """Finished stages in a folder, or nowhere where that is None; progress(stage, done, of) is told of each."""

    def __init__(self, folder: Path | None, progress: Progress | None = None):
        self.folder = folder
        self.progress: Progress = progress or (lambda stage, done, of: None)

    def of(
        self, name: str, kind: type[Record], depends: str, make: Callable[[], Record], *, tell: bool = True
    ) -> Record:
        """The record of a stage: from its file if that was made for the same digest, else made and filed."""
        found = self.found(name, kind, depends)
        if found is None:
            if tell:
                self.progress(name, 0, 1)
            found = make()
            self.keep(name, found, depends)
        if tell:
            self.progress(name, 1, 1)
        return found

    def keep(self, name: str, record: Any, depends: str) -> None:
        """File a record, where there is a folder."""
        if self.folder is not None:
            _file(self.folder, name, record, depends)

    def found(self, name: str, kind: type[Record], depends: str) -> Record | None:
        """The record on file if it was made for the same digest and can be read."""
        if self.folder is None or not (path := _path(self.folder, name)).is_file():
            return None
        try:
            with np.load(path, allow_pickle=False) as archive:
                if str(archive["digest"]) != depends:
                    return None
                words = json.loads(str(archive["words"]))
                arrays = {key[1:]: archive[key] for key in archive.files if key.startswith(".")}
            return kind(**arrays, **{key: _frozen(value) for key, value in words.items()})
        except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile):
            return None  # damaged, or of another version


def _path(folder: Path, name: str) -> Path:
    return folder / "stages" / f"{name}.npz"


def _file(folder: Path, name: str, record: Any, depends: str) -> None:
    path = _path(folder, name)
    path.parent.mkdir(parents=True, exist_ok=True)
    values = {field.name: getattr(record, field.name) for field in fields(record)}
    arrays = {f".{key}": value for key, value in values.items() if isinstance(value, np.ndarray)}
    words = {key: value for key, value in values.items() if not isinstance(value, np.ndarray)}
    with replacing(path) as partial:
        contents: dict[str, Any] = dict(arrays, digest=np.array(depends), words=np.array(json.dumps(words)))
        np.savez(partial, **contents)


def _frozen(value: Any) -> Any:
    return tuple(_frozen(each) for each in value) if isinstance(value, list) else value
