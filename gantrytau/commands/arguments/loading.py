"""Files and modules of the user as Python modules; what fails in them is told with its lines."""

import difflib
import importlib
import importlib.util
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from types import ModuleType
from typing import Any

from gantrytau import GantryTauError, did_you_mean
from gantrytau.commands.printing.reporting import CommandError, in_words, places


def load(file: Path) -> ModuleType:
    """The user's file as a module; it may import its neighbours."""
    if not file.is_file():
        there = sorted(path.name for path in file.parent.glob("*.py")) if file.parent.is_dir() else []
        raise CommandError(f"{file}: there is no such file{similar(file.name, there)}")
    specification = importlib.util.spec_from_file_location(f"{file.stem}__model", file)
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    sys.modules[module.__name__] = module
    with _loading(file.name, file.parent, file):
        specification.loader.exec_module(module)
    return module


def import_by_name(name: str, source: Path | None) -> ModuleType | None:
    """The module `package.module`, also of the current folder; None if there is no module of this name.

    source: its file, if it is one of the user's, of which the lines that fail are shown.
    """
    with _loading(name, Path.cwd(), source):
        try:
            return importlib.import_module(name)
        except ModuleNotFoundError as error:
            if error.name is None or not f"{name}.".startswith(f"{error.name}."):
                raise  # it is there, but imports something that is not
        except (ValueError, TypeError):  # no name of a module, as 'a..b'
            pass
    return None


@contextmanager
def _loading(name: str, folder: Path, source: Path | None) -> Iterator[None]:
    """While it lasts, modules of `folder` can be imported; what they print goes to stderr."""
    sys.path.insert(0, str(folder))
    try:
        with redirect_stdout(sys.stderr):
            yield
    except GantryTauError:
        raise
    except (Exception, SystemExit) as error:
        raise CommandError(f"{name} cannot be loaded. {in_words(error, places(error, source))}") from error
    finally:
        if str(folder) in sys.path:
            sys.path.remove(str(folder))


def similar(wrong: str, names: Sequence[str] | dict[str, Any]) -> str:
    """The closest name, whatever its capitals, as a question; else all names."""
    lower = {name.lower(): name for name in names}
    close = difflib.get_close_matches(wrong.lower(), lower, n=1, cutoff=0.5)
    return did_you_mean(lower[close[0]] if close else wrong, names)
