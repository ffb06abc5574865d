"""Small FMUs compiled from a few lines of C, for tests of co-simulation: FMI 2.0 and 3.0, with known solutions.

The model is given as C code over the array v of all variables, in the order of `variables`:
`derive` computes outputs, and `advance` goes from time t over h. Both versions share the code.
"""

import inspect
import os
import shutil
import subprocess
import zipfile
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

import fmpy
import pytest
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave

from tests.fmu.binaries_kept import binary

CODE = Path(__file__).with_name("small_fmu.c")


def variable(name, causality, start=None, *, unit="", variability=None, kind="real"):
    """A line of `variables`: name, causality, start value, unit, variability, real or integer."""
    return (name, causality, start, unit, variability, kind)


class Builder:
    """Makes FMUs in a folder; each has a library of its own."""

    def __init__(self, folder):
        self.folder = folder
        self.compiler = (
            os.environ.get("CC") or shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
        )
        if self.compiler is None:
            pytest.skip("no C compiler")

    def __call__(
        self, name, variables, *, derive="", advance="", fmi="2.0", direct=(), can_save=True, even=False
    ):
        """An FMU; direct: names of outputs that depend on all inputs at once; even: equal steps only."""
        library = self._library(name, variables, derive, advance)
        describe = _describe_2 if fmi == "2.0" else _describe_3
        old = fmi == "2.0" and fmpy.architecture == "x86_64"
        folder = fmpy.platform if old else fmpy.platform_tuple
        path = self.folder / f"{name}.fmu"
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("modelDescription.xml", describe(name, variables, direct, can_save, not even))
            archive.writestr(f"binaries/{folder}/{name}{fmpy.sharedLibraryExtension}", library)
        return path

    def _library(self, name, variables, derive, advance):
        starts = ", ".join(str(line[2] or 0.0) for line in variables)
        defined = {"N": len(variables), "STARTS": starts, "DERIVE": derive, "ADVANCE": advance}
        lines = [f"#define {word} {' '.join(str(code).split())}" for word, code in defined.items()]
        text = "\n".join([*lines, f'#include "{CODE.as_posix()}"', *_stubs(CODE.read_text())]) + "\n"
        command = [self.compiler, "-shared", "-fPIC", "-w", "-O0"]

        def make():
            source, library = self.folder / f"{name}.c", self.folder / f"{name}{fmpy.sharedLibraryExtension}"
            source.write_text(text)
            subprocess.run(
                [*command, str(source), "-o", str(library), "-lm"], check=True, capture_output=True
            )
            return library.read_bytes()

        return binary(command, {"model": text, "common": CODE.read_text()}, make)


def _stubs(text):
    """The functions that FMPy looks for and no test calls."""
    names = [
        name
        for kind in (FMU2Slave, FMU3Slave)
        for name, _ in inspect.getmembers(kind)
        if name[:4] in ("fmi2", "fmi3")
    ]
    return [
        f"int {name}(void) {{ return 3; }}"
        for name in sorted(set(names))
        if f" {name}(" not in text and f"*{name}(" not in text
    ]


def _attributes(line, reference, fmi):
    name, causality, start, unit, variability, kind = line
    chosen = variability or (
        "fixed" if causality == "parameter" else "continuous" if kind == "real" else "discrete"
    )
    initial = (
        "exact"
        if causality == "parameter"
        else "exact"
        if causality == "local" and start is not None
        else None
    )
    text = (
        f' name={quoteattr(name)} valueReference="{reference}" causality="{causality}" variability="{chosen}"'
    )
    return text + (f' initial="{initial}"' if initial else ""), start if causality != "output" else None, unit


def _describe_2(name, variables, direct, can_save, variable_step):
    lines = []
    for reference, line in enumerate(variables):
        text, start, unit = _attributes(line, reference, 2)
        inner = (f' start="{start}"' if start is not None else "") + (
            f" unit={quoteattr(unit)}" if unit and line[5] == "real" else ""
        )
        lines.append(
            f"<ScalarVariable{text}><{'Real' if line[5] == 'real' else 'Integer'}{inner}/></ScalarVariable>"
        )
    known = " ".join(str(k + 1) for k, line in enumerate(variables) if line[1] == "input")
    outputs = [(k + 1, line[0]) for k, line in enumerate(variables) if line[1] == "output"]
    structure = "".join(
        f'<Unknown index="{k}" dependencies="{known if label in direct else ""}"/>' for k, label in outputs
    )
    body = f"<Outputs>{structure}</Outputs><InitialUnknowns>{structure}</InitialUnknowns>" if outputs else ""
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="2.0" modelName="{name}" guid="{{{name}}}" '
        f'numberOfEventIndicators="0"><CoSimulation modelIdentifier="{name}" canGetAndSetFMUstate="{str(can_save).lower()}" '
        f'canHandleVariableCommunicationStepSize="{str(variable_step).lower()}"/>{_units(variables)}'
        f'<LogCategories><Category name="logStatusError"/></LogCategories>'
        f"<ModelVariables>{''.join(lines)}</ModelVariables><ModelStructure>{body}</ModelStructure></fmiModelDescription>"
    )


def _describe_3(name, variables, direct, can_save, variable_step):
    lines = ['<Float64 name="time" valueReference="9999" causality="independent" variability="continuous"/>']
    for reference, line in enumerate(variables):
        text, start, unit = _attributes(line, reference, 3)
        text += (f' start="{start}"' if start is not None else "") + (
            f" unit={quoteattr(unit)}" if unit and line[5] == "real" else ""
        )
        lines.append(f"<{'Float64' if line[5] == 'real' else 'Int32'}{text}/>")
    known = " ".join(str(k) for k, line in enumerate(variables) if line[1] == "input")
    outputs = [(k, line[0]) for k, line in enumerate(variables) if line[1] == "output"]
    body = "".join(
        f'<Output valueReference="{k}" dependencies="{known if label in direct else ""}"/>'
        for k, label in outputs
    )
    body += "".join(
        f'<InitialUnknown valueReference="{k}" dependencies="{known if label in direct else ""}"/>'
        for k, label in outputs
    )
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="3.0" modelName="{name}" '
        f'instantiationToken="{{{name}}}"><CoSimulation modelIdentifier="{name}" canGetAndSetFMUState="'
        f'{str(can_save).lower()}" '
        f'canHandleVariableCommunicationStepSize="{str(variable_step).lower()}"/>{_units(variables)}'
        f'<LogCategories><Category name="logStatusError"/></LogCategories>'
        f"<ModelVariables>{''.join(lines)}</ModelVariables><ModelStructure>{body}</ModelStructure></fmiModelDescription>"
    )


def _units(variables):
    base = {
        "m": 'm="1"',
        "N": 'kg="1" m="1" s="-2"',
        "m/s": 'm="1" s="-1"',
        "mm": 'm="1" factor="0.001"',
        "kg": 'kg="1"',
        "N/m": 'kg="1" s="-2"',
        "degC": 'K="1" offset="273.15"',
        "furlong": 'm="1" factor="201.168"',
    }
    units = sorted({line[3] for line in variables if line[3] and line[5] == "real"})
    text = "".join(f'<Unit name="{escape(unit)}"><BaseUnit {base[unit]}/></Unit>' for unit in units)
    return f"<UnitDefinitions>{text}</UnitDefinitions>" if text else ""
