"""What an FMU brings along to be judged by: reference results, and the equations of its DAE as text.

Reference results and equations are listed in the manifest of FMI-LS-REF 1.0.0-beta.1, a layered standard for files related
to an FMU that is not final yet. The equations stand in the folder of a layered standard that exists as our draft only;
tools that know neither take the FMU as a plain one (FMI 3.0.2, section 2.5.1: `extra`; FMI 2.0.4 has the same folder).
"""

import hashlib
import re
from collections.abc import Mapping, Sequence

import numpy as np

from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.language.symbols import derivative_name, split_derivative
from gantrytau.results.result import Result
from gantrytau_fmu.describing.xml_text import HEAD, element, parent
from gantrytau_fmu.description import FmuDescription

FOLDER, DRAFT = "extra/org.fmi-standard.fmi-ls-ref/", "extra/io.github.gantrytau.fmi-ls-dae-draft/"
MANIFEST = f"{FOLDER}fmi-ls-manifest.xml"
ORIGIN = "io.github.gantrytau.origin"  # type of the annotation with the FMU's token and a file's digest
_HIGHER = re.compile(r"der\((.+),(\d+)\)")  # der(x,2) of the FMU is der(der(x)) of the model
_RESULTS, _EQUATIONS = f"{FOLDER}reference.csv", f"{DRAFT}equations.mo"


def reference_members(fmu: FmuDescription, reference: Result, equations: str) -> dict[str, bytes]:
    """The files below `extra` by their names: results of the inputs and outputs, equations if there are any, manifests.

    Raises ModelError for a result without one of these variables, with one that is not finite, or not from 0 s on.
    """
    shown = [v.name for v in fmu.variables if v.causality in ("input", "output")]
    members = {_RESULTS: _csv(reference, shown)}
    words, jumps = "Reference results", {"jumps": _jumps(fmu, reference)}
    related = [_related(fmu, members[_RESULTS], _RESULTS, "result", words, jumps)]
    if equations:
        members[_EQUATIONS] = equations.encode()
        words = "Equations of the DAE as Base Modelica"
        related.append(_related(fmu, members[_EQUATIONS], _EQUATIONS, "model", words, {}))
        entry = element("Equations", {"language": "base-modelica", "source": "equations.mo"})
        words = "Draft, no released standard: equations of the DAE that an FMU computes."
        members[f"{DRAFT}fmi-ls-manifest.xml"] = _manifest("fmiDae", DRAFT, "0.1.0-draft", words, [entry])
    words = "Layered Standard providing information on related files included in an FMU."
    return {**members, MANIFEST: _manifest("fmiReferences", FOLDER, "1.0.0-beta.1", words, related)}


def digest(content: bytes) -> str:
    """SHA-256 of a file, in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def _csv(reference: Result, names: Sequence[str]) -> bytes:
    """Time and variables, one row for each time, with all digits."""
    place = "export_fmu: reference"
    span = reference.time[[0, -1]]
    if span[0] != 0.0 or span[1] <= 0.0:
        found = f"found results from {span[0]:g} to {span[1]:g} s, expected some from 0 s on; simulate without start="
        raise ModelError(found, place=place, argument="reference")
    columns = [reference.time, *(_column(reference, name, place) for name in names)]
    rows = np.column_stack(columns).tolist()
    quoted = ",".join('"{}"'.format(name.replace('"', '""')) for name in ("time", *names))
    return "\n".join([quoted, *(",".join(map(repr, row)) for row in rows), ""]).encode()


def _column(reference: Result, name: str, place: str) -> np.ndarray:
    """The values of a variable; derivatives of an input that does not move are zero."""
    higher = _HIGHER.fullmatch(name)
    name = derivative_name(higher[1], int(higher[2])) if higher else name
    below, order = split_derivative(name)
    if name not in reference and order and below in reference and not np.ptp(reference[below]):
        return np.zeros_like(reference.time)
    if name not in reference:
        found = f"found no '{name}' in the result, expected all inputs and outputs of the FMU"
        remedy = f"say the outputs by find={did_you_mean(name, reference.names)}"
        raise ModelError(f"{found}; {remedy}", place=place, argument="reference")
    bad = np.flatnonzero(~np.isfinite(reference[name]))
    if bad.size:
        found = f"{name} is {reference[name][bad[0]]} at t = {reference.time[bad[0]]:.6g} s, expected a finite number"
        raise ModelError(f"{found}; stop before it", place=place, argument="reference")
    return reference[name]


def _jumps(fmu: FmuDescription, reference: Result) -> str:
    """The rows, from 0, before which something is sampled or switched: an importer may see it a step later."""
    steps = {v.name for v in fmu.variables if v.variability == "discrete" and v.name in reference}
    changes = [np.diff(reference[name]) != 0 for name in sorted(steps | reference.held)]
    return " ".join(map(str, np.flatnonzero(np.any([np.diff(reference.time) == 0, *changes], axis=0)) + 1))


def _related(
    fmu: FmuDescription, content: bytes, name: str, role: str, words: str, more: Mapping[str, str]
) -> str:
    """The entry of a file, with what tells later whether it, or the FMU, has been changed."""
    origin = element("origin", {"token": fmu.token, "sha256": digest(content), **more})
    note = parent("Annotations", [element("Annotation", {"type": ORIGIN}, origin)])
    source = name.removeprefix(FOLDER) if name.startswith(FOLDER) else name.replace("extra/", "../", 1)
    kind = "text/csv" if role == "result" else "text/modelica"
    return element("Related", {"type": kind, "source": source, "role": role, "description": words}, note)


def _manifest(root: str, folder: str, version: str, words: str, entries: Sequence[str]) -> bytes:
    """The manifest of a layered standard (FMI 3.0.2, section 2.6)."""
    named = {
        "xmlns:fmi-ls": "http://fmi-standard.org/fmi-ls-manifest",
        "fmi-ls:fmi-ls-name": folder.split("/")[1],
        "fmi-ls:fmi-ls-version": version,
        "fmi-ls:fmi-ls-description": words,
    }
    return (HEAD + parent(root, entries, named)).encode()
