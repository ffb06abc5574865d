"""What people hand in: refusals, checks, units, tables, files of settings and names, the same at every border."""

from gantrytau.border.named import NamedObject, NotLoaded, import_by_name, listed, load, similar, source_of
from gantrytau.border.refusal import python_error, user_lines

__all__ = [
    "NamedObject",
    "NotLoaded",
    "import_by_name",
    "listed",
    "load",
    "python_error",
    "similar",
    "source_of",
    "user_lines",
]
