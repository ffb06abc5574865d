"""Reference results of an FMU, of any tool: found, read, and compared with what the FMU says of itself.

They stand in the archive, listed by the manifest of FMI-LS-REF, or as `NAME_ref.csv` with inputs in `NAME_in.csv` beside
the file, as was customary before.
"""

import posixpath
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree

import numpy as np

from gantrytau.border.columns import Columns
from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.results.series import split_element
from gantrytau_fmu.describing.reference_files import FOLDER, MANIFEST, ORIGIN, digest
from gantrytau_fmu.reading.fmu_file import FmuFile
from gantrytau_fmu.reading.fmu_findings import FmuFinding, fault
from gantrytau_fmu.reading.safety import Archive, open_archive

_AGAIN = "ask its author for it again"
_ROLES = ("result", "model")
_ABSOLUTE = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:")  # a URI, which is left alone


@dataclass(frozen=True, eq=False)
class ReferenceResults:
    """Results that an FMU has to reproduce.

    name: of the file; own: written by this toolkit, and so of all inputs and outputs; time: (n,) in s, not decreasing;
    values: of outputs by name, (n,); inputs: by name their times and values; jumps: rows before which something is sampled
    or switched, of own results.
    """

    name: str
    own: bool
    time: np.ndarray
    values: Mapping[str, np.ndarray]
    inputs: Mapping[str, tuple[np.ndarray, np.ndarray]]
    jumps: tuple[int, ...] = ()


def references_of(fmu: FmuFile) -> Iterator[ReferenceResults | FmuFinding]:
    """Reference results that can be compared, and what is wrong with others."""
    with open_archive(fmu.path, verify=False) as archive:
        if MANIFEST in archive.names:
            yield from _listed(archive, fmu)
            return
        if any(name.startswith(FOLDER) for name in archive.names):
            yield FmuFinding(
                "warning", f"found files in {FOLDER} but no {MANIFEST}, which lists them; {_AGAIN}"
            )
    beside, inputs = (fmu.path.with_name(f"{fmu.path.stem}_{end}.csv") for end in ("ref", "in"))
    if beside.is_file():
        contents = [file.read_bytes() for file in (beside, inputs) if file.is_file()]
        yield from _read(fmu, beside.name, None, *contents)


def _listed(archive: Archive, fmu: FmuFile) -> Iterator[ReferenceResults | FmuFinding]:
    """What the manifest lists; FMI-LS-REF asks importers to be prepared for files that are gone."""
    root = ElementTree.fromstring(archive.xml(MANIFEST))
    if root.tag != "fmiReferences":
        yield fault(f"{MANIFEST} begins with '{root.tag}', expected fmiReferences; {_AGAIN}")
    for related in root.iter("Related"):
        source, role = related.get("source", ""), related.get("role", "")
        if role not in _ROLES or _ABSOLUTE.match(source):
            continue
        name = posixpath.normpath(posixpath.join(FOLDER, unquote(source)))
        if name not in archive.names:
            words = f"{MANIFEST} lists '{name}' as {role}, found no such file; {_AGAIN}"
            yield FmuFinding("warning", words)
            continue
        content = archive.read(name)
        origin = related.find(f"Annotations/Annotation[@type='{ORIGIN}']/origin")
        if origin is not None:
            yield from _changed(name, content, origin, fmu.token)
        if role == "result" and (related.get("type") == "text/csv" or name.endswith(".csv")):
            yield from _read(fmu, name, origin, content)


def _changed(name: str, content: bytes, origin: ElementTree.Element, token: str) -> Iterator[FmuFinding]:
    """Whether a file, or the equations of its FMU, are others than when it was written."""
    found, expected = digest(content), origin.get("sha256", "")
    if found != expected:
        words = f"found a file with SHA-256 {found[:12]}, expected {expected[:12]}: it was altered since the export"
        yield fault(f"{name}: {words}; {_AGAIN}")
    if token != origin.get("token"):
        words = f"found results or equations of an FMU with the token {origin.get('token')}, expected {token}"
        yield fault(f"{name}: {words}: the equations are others; export it again with its reference")


def _read(
    fmu: FmuFile,
    name: str,
    origin: ElementTree.Element | None,
    content: bytes,
    inputs: bytes | None = None,
) -> Iterator[ReferenceResults | FmuFinding]:
    """The results in a file, with inputs in the same or in another; else what is wrong."""
    try:
        time, values = _columns(fmu, name, content)
        driven = (time, values) if inputs is None else _columns(fmu, f"the inputs of {name}", inputs)
    except ModelError as error:
        yield fault(str(error))
        return
    seen = {k: x for k, x in values.items() if k in fmu.outputs or split_element(k)}
    given = {k: (driven[0], x) for k, x in driven[1].items() if k in fmu.inputs}
    own = origin is not None
    jumps = (
        tuple(int(k) for k in origin.get("jumps", "").split() if re.fullmatch(r"\d{1,9}", k)) if own else ()
    )
    missing = [k for k in (*fmu.inputs, *fmu.outputs) if own and k not in seen and k not in given]
    if missing:
        more = f" (and {len(missing) - 1} more)" if len(missing) > 1 else ""
        yield fault(
            f"{name}: found no column '{missing[0]}'{more}, expected all inputs and outputs; {_AGAIN}"
        )
    elif seen:
        yield ReferenceResults(
            name, own, time, {k: x for k, x in seen.items() if k not in given}, given, jumps
        )


def _columns(fmu: FmuFile, name: str, content: bytes) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Times in s, and columns by the names of variables; ModelError for what no run of the FMU can have."""
    table = Columns.parse(content, Path(name))
    time = table.time
    if time is None:
        raise ModelError(f"{name}: found no column 'time', expected times in s; add it")
    falls = np.flatnonzero(np.diff(time) < 0)
    if falls.size:
        row = falls[0] + 1
        words = (
            f"the time falls from {time[row - 1]:g} to {time[row]:g} s, expected rising times; sort the rows"
        )
        raise ModelError(f"{name}: line {table.lines[row]}: {words}")
    if time[0] != 0.0 or time[-1] <= 0.0:
        raise ModelError(
            f"{name}: found results from {time[0]:g} to {time[-1]:g} s, expected some from 0 s on; {_AGAIN}"
        )
    values = {}
    for place, (heading, plain) in enumerate(zip(table.header, table.names, strict=True)):
        variable = heading if heading in fmu.by_name else plain
        base = split_element(variable)
        if plain == table.time_name:
            continue
        if variable not in fmu.by_name and (base is None or base[0] not in fmu.by_name):
            proposed = did_you_mean(variable, fmu.by_name)
            raise ModelError(
                f"{name}: found a column '{variable}', expected variables of the FMU{proposed}; rename it"
            )
        if variable in values:
            raise ModelError(f"{name}: found two columns '{variable}', expected different names; {_AGAIN}")
        values[variable] = table.column(variable, filled=True, si=False, place=place)
    return time, values
