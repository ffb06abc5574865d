"""`gantrytau fmu export`: a model as an FMU."""

import time
import warnings
from pathlib import Path
from typing import Annotated, Any

import typer

from gantrytau import flatten
from gantrytau.border import listed, number, source_of
from gantrytau.commands.arguments.model_choice import build
from gantrytau.commands.arguments.option import serves
from gantrytau.commands.arguments.options import Json, ModelName, PrototypeName, Settings
from gantrytau.commands.arguments.values import check_names
from gantrytau.commands.fmu import export_options
from gantrytau.commands.fmu.fmu_info import counted
from gantrytau.commands.printing.reporting import CommandError, answered, busy, note, refusing, reporting
from gantrytau_fmu import Build, DefaultExperiment, check_target, export_fmu, read_fmu


@serves(export_fmu, **export_options.OPTIONS)
@serves(Build, **export_options.BUILD)
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
    stop: export_options.Stop = None,
    step: export_options.Step = None,
    reference: export_options.Reference = False,
    prototype: PrototypeName = None,
    set_: Settings = None,
    json: Json = False,
    **policy: Any,
) -> None:
    """Write a model as an FMU, for Simulink, Dymola, OpenModelica, or a machine without Python.

    Which way the model is solved is your choice: given the tool's position and finding the forces, the FMU is
    inverse dynamics. It needs a C compiler here, or the extra 'cross' of gantrytau; without one, only sources are written.
    """
    with reporting(json, source_of(model)):
        names: dict[str, Any] = {
            "given": listed(given),
            "find": listed(find),
            "states": listed(states) or None,
        }
        about = {name: policy.pop(name) for name in export_options.BUILD}
        experiment = _experiment(stop, step, policy["tolerance"])
        wanted = Build(
            **about,
            platforms=listed(platforms) or ("native",),
            sources=not no_sources,
            experiment=experiment,
        )
        policy |= names | {
            "fmi": export_options.VERSIONS.get(fmi, fmi),
            "interfaces": export_options.INTERFACES[interface],
            "build": wanted,
            "reference": reference,
        }
        chosen = build(model, prototype, set_ or ())
        flat = flatten(chosen.model)
        for argument, asked in names.items():
            check_names(f"--{argument}", asked or (), flat.expand)
        file = to or Path(f"{chosen.name}.fmu")
        with refusing("--to "):
            check_target(file)
        begin = time.perf_counter()
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            with busy(f"exporting {chosen.name} for {', '.join(wanted.platforms)}"):
                export_fmu(chosen.model, file, **policy)
        told = list(dict.fromkeys(str(warning.message) for warning in caught))
        _answer(chosen.record("model"), file, time.perf_counter() - begin, told, json)


def _experiment(stop: float | None, step: float | None, tolerance: float) -> DefaultExperiment | None:
    """The default experiment, None if nothing is said of it; CommandError for a step that does not fit."""
    if stop is None and step is None:
        return None
    usual = DefaultExperiment()
    stop = number("export", "stop", usual.stop if stop is None else stop, above=0.0)
    if step is not None and not 0 < step <= stop:
        raise CommandError(f"--step {step:g}: expected more than 0 and at most the {stop:g} s until the stop")
    return DefaultExperiment(stop=stop, step=step or min(usual.step or stop, stop), tolerance=tolerance)


def _answer(chosen: dict[str, Any], file: Path, seconds: float, told: list[str], json: bool) -> None:
    """The file, what is in it, and how long it took."""
    fmu = read_fmu(file)
    kinds = {
        "inputs": fmu.inputs,
        "outputs": fmu.outputs,
        "parameters": fmu.parameters,
        "states": fmu.states,
    }
    record = {**chosen, "file": file, "size": fmu.size, "fmi": fmu.fmi, "platforms": fmu.platforms, **kinds}
    record |= {"variables": len(fmu.variables), "seconds": seconds, "warnings": told}
    if not json:
        for words in told:
            note(f"Note: {words}")
    counts = ", ".join(counted(len(names), word.removesuffix("s")) for word, names in kinds.items())
    answered(
        json,
        record,
        f"{chosen['model']}, FMI {fmu.fmi}: {counts}, {counted(len(fmu.variables), 'variable')} in all\n"
        f"Platforms: {', '.join(fmu.platforms) or 'none, sources only'}\n"
        f"{fmu.size / 1000:,.0f} kB in {seconds:.2f} s",
        [file],
    )
