"""What can be a component: an FMU file, a model, which becomes one, and a Python function."""

import os
from pathlib import Path

from gantrytau import Dae, Model
from gantrytau.border.refusal import ModelError
from gantrytau_fmu.export import Build, export_fmu
from gantrytau_fmu.reading.safety import unpack
from gantrytau_fmu.systems.component import Component, read_component
from gantrytau_fmu.systems.isolation import Isolated
from gantrytau_fmu.systems.master import RunningComponent
from gantrytau_fmu.systems.slave import Slave
from gantrytau_fmu.systems.sources.python_component import PythonComponent

Source = str | os.PathLike[str] | Model | Dae | PythonComponent


def describe_source(name: str, source: Source, folder: Path, tolerance: float | None = None) -> Component:
    """A component under its name in a system; unpacked, and a model compiled, in a folder that is not there yet.

    tolerance: that a model is integrated with, 1e-6 if None. Raises ModelError for a source that is none of these, what
    `export_fmu` and `read_component` raise.
    """
    if isinstance(source, PythonComponent):
        return source.component(name)
    if isinstance(source, (Model, Dae)):
        file = folder.with_suffix(".fmu")
        export_fmu(
            source, file, interfaces="co-simulation", tolerance=tolerance or 1e-6, build=Build(sources=False)
        )
        words = source.name if isinstance(source, Dae) else type(source).__name__
        return read_component(name, words, unpack(file, folder))
    if isinstance(source, (str, os.PathLike)):
        return read_component(name, os.fspath(source), unpack(source, folder))
    remedy = (
        "; PythonComponent(function, inputs=..., outputs=...) says what a function takes"
        if callable(source)
        else ""
    )
    raise ModelError(
        f"{name}: found {source!r}, expected an FMU file, a model instance or a PythonComponent{remedy}"
    )


def run_source(component: Component, source: Source, timeout: float | None = None) -> RunningComponent:
    """A running instance; timeout: s that one call may take in a process of its own, None for this process."""
    if isinstance(source, PythonComponent):
        return source.running(component)
    return Slave(component) if timeout is None else Isolated(component, timeout)
