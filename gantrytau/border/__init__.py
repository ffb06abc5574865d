"""What people hand in: refusals, checks, units, tables, files of settings and names, the same at every border."""

from gantrytau.border.checks import number
from gantrytau.border.named import (
    NamedObject,
    NotLoaded,
    import_by_name,
    listed,
    load,
    named,
    prototype,
    similar,
    source_of,
)
from gantrytau.border.refusal import Given, Sentence, meant, python_error, short, user_lines
from gantrytau.border.schema import Value, at, read_table

__all__ = [
    "Given",
    "NamedObject",
    "NotLoaded",
    "Sentence",
    "Value",
    "at",
    "import_by_name",
    "listed",
    "load",
    "meant",
    "named",
    "number",
    "prototype",
    "python_error",
    "read_table",
    "short",
    "similar",
    "source_of",
    "user_lines",
]
