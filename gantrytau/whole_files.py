"""Files that appear whole: a reader never sees half of one, and an error leaves the old one in its place."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gantrytau.border.refusal import ModelError
from gantrytau.interruption import uninterrupted


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A name beside `path` to write to; it takes the place of `path` at the end, or vanishes on an error; Ctrl-C waits."""
    path = Path(path)
    if not path.parent.is_dir():
        raise ModelError(
            f"the folder '{path.parent}' does not exist; create it, or name another one", place=str(path)
        )
    partial = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        with uninterrupted():
            yield partial
            os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)
