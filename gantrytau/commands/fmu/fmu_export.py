"""`gantrytau fmu export`: a model as an FMU."""

import math
import time
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gantrytau import did_you_mean, flatten
from gantrytau.border import listed, source_of
from gantrytau.commands.arguments.model_choice import Chosen, build
from gantrytau.commands.arguments.options import Json, ModelName, PrototypeName, Settings
from gantrytau.commands.arguments.values import check_names
from gantrytau.commands.fmu import export_options
from gantrytau.commands.fmu.fmu_info import counted
from gantrytau.commands.printing.reporting import CommandError, as_json, busy, note, refusing, reporting

if TYPE_CHECKING:
    from gantrytau_fmu import DefaultExperiment


def export(
    model: ModelName,
    to: Annotated[
        Path | None, typer.Option(help="The file to write.", show_default="the model's name.fmu")
    ] = None,
    fmi: export_options.Version = "3.0",
    platforms: export_options.Platforms = None,
    interface: export_options.Interface = "both",
    no_sources: export_options.NoSources = False,
    given: export_options.Given = None,
    find: export_options.Find = None,
    states: export_options.States = None,
    solver: export_options.SolverName = "dopri5",
    tolerance: export_options.Tolerance = 1e-6,
    stop: export_options.Stop = None,
    step: export_options.Step = None,
    description: export_options.Description = "",
    author: export_options.Author = "",
    copyright_: export_options.Copyright = "",
    license_: export_options.License = "",
    model_version: export_options.ModelVersion = "",
    prototype: PrototypeName = None,
    set_: Settings = None,
    json: Json = False,
) -> None:
    """Write a model as an FMU, for Simulink, Dymola, OpenModelica, or a machine without Python.

    Which way the model is solved is your choice: given the tool's position and finding the forces, the FMU is
    inverse dynamics. It needs a C compiler here, or the extra 'cross' of gantrytau; without one, only sources are written.
    """
    from gantrytau_fmu import SOLVERS, Build

    with reporting(json, source_of(model), export_options.SPELLING):
        policy: dict[str, Any] = {
            "fmi": export_options.VERSIONS.get(fmi) or _unknown("--fmi", fmi, ("2.0", "3.0")),
            "interfaces": export_options.INTERFACES.get(interface)
            or _unknown("--interface", interface, export_options.INTERFACES),
            "solver": solver if solver in SOLVERS else _unknown("--solver", solver, SOLVERS),
            "tolerance": tolerance,
            "given": listed(given),
            "find": listed(find),
            "states": listed(states) or None,
            "build": Build(
                description=description,
                author=author,
                copyright=copyright_,
                license=license_,
                version=model_version,
                platforms=listed(platforms) or ("native",),
                sources=not no_sources,
                experiment=_experiment(stop, step, tolerance),
            ),
        }
        chosen = build(model, prototype, set_ or ())
        flat = flatten(chosen.model)
        for option in ("given", "find", "states"):
            check_names(f"--{option}", policy[option] or (), flat.expand)
        file = to or Path(f"{chosen.name}.fmu")
        _check(file)
        begin = time.perf_counter()
        told = _exported(chosen, file, policy)
        _show(chosen, file, time.perf_counter() - begin, told, json)


def _experiment(stop: float | None, step: float | None, tolerance: float) -> "DefaultExperiment | None":
    """The default experiment (`DefaultExperiment`), None if nothing is said of it; CommandError for times that are none."""
    if stop is None and step is None:
        return None
    from gantrytau_fmu import DefaultExperiment

    if stop is not None and not 0 < stop < math.inf:
        raise CommandError(f"--stop {stop:g}: expected a time above 0, in s")
    usual = DefaultExperiment()
    stop = stop or usual.stop or 1.0
    if step is not None and not 0 < step <= stop:
        raise CommandError(f"--step {step:g}: expected more than 0 and at most the {stop:g} s until the stop")
    return DefaultExperiment(stop=stop, step=step or min(usual.step or stop, stop), tolerance=tolerance)


def _unknown(option: str, found: str, expected: Any) -> Any:
    raise CommandError(f"{option} {found}: expected {' or '.join(expected)}{_proposed(found, expected)}")


def _proposed(found: str, expected: Any) -> str:
    """The nearest word as a question; nothing if none is near, as the message lists all."""
    words = did_you_mean(found, expected)
    return words if "did you mean" in words else ""


def _check(file: Path) -> None:
    """Find out before the work whether the file can be written; CommandError if not."""
    from gantrytau_fmu import check_target

    with refusing("--to "):
        check_target(file)


def _exported(chosen: Chosen, file: Path, policy: dict[str, Any]) -> list[str]:
    """Write the FMU; what its writer warns of."""
    from gantrytau_fmu import export_fmu

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        platforms = ", ".join(policy["build"].platforms)
        with busy(f"exporting {chosen.name} for {platforms}"):
            export_fmu(chosen.model, file, **policy)
    return list(dict.fromkeys(str(warning.message) for warning in caught))


def _show(chosen: Chosen, file: Path, seconds: float, told: list[str], json: bool) -> None:
    """The file, what is in it, and how long it took."""
    from gantrytau_fmu import read_fmu

    fmu = read_fmu(file)
    if json:
        found = {
            "model": chosen.name,
            "prototype": chosen.prototype,
            "file": str(file),
            "size": fmu.size,
            "fmi": fmu.fmi,
            "platforms": fmu.platforms,
            "inputs": fmu.inputs,
            "outputs": fmu.outputs,
            "parameters": fmu.parameters,
            "states": fmu.states,
            "variables": len(fmu.variables),
            "seconds": seconds,
            "warnings": told,
        }
        typer.echo(as_json(found))
        return
    for words in told:
        note(f"Note: {words}")
    kinds = (
        ("input", fmu.inputs),
        ("output", fmu.outputs),
        ("parameter", fmu.parameters),
        ("state", fmu.states),
    )
    counts = ", ".join(counted(len(names), word) for word, names in kinds)
    typer.echo(f"{chosen.name}, FMI {fmu.fmi}: {counts}, {counted(len(fmu.variables), 'variable')} in all")
    typer.echo(f"Platforms: {', '.join(fmu.platforms) or 'none, sources only'}")
    typer.echo(f"Written: {file} ({fmu.size / 1000:,.0f} kB) in {seconds:.2f} s")
