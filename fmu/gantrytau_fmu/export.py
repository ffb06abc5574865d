"""`export_fmu`: from a model to a file that simulation tools import."""

import hashlib
import re
import warnings
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields, replace
from datetime import UTC, datetime
from importlib import resources
from pathlib import Path
from typing import Literal

import casadi as ca
import numpy as np

from gantrytau import Dae, Input, Model, Real, sampled, simulate, translate
from gantrytau.answers.sampled_code import SampledCode
from gantrytau.border.checks import check_words, instance, number, one_of
from gantrytau.border.refusal import Given, ModelError
from gantrytau.results.result import Result
from gantrytau_fmu.building.archive import binary_members, check_target, write_archive
from gantrytau_fmu.building.compile_libraries import NoCompiler, compile_libraries
from gantrytau_fmu.building.platforms import Platform, chosen
from gantrytau_fmu.code.contents import Contents, contents_of
from gantrytau_fmu.code.formulas import Formulas, formulas_of
from gantrytau_fmu.code.jumps import with_ends_of_tables
from gantrytau_fmu.code.model_code import model_code
from gantrytau_fmu.code.model_graph import entered
from gantrytau_fmu.describing.description_checks import STRUCTURED
from gantrytau_fmu.describing.documentation import documentation, licenses
from gantrytau_fmu.describing.fmi2_description import in_fmi_2
from gantrytau_fmu.describing.model_description import COMPILED, build_description, model_description
from gantrytau_fmu.describing.reference_files import reference_members
from gantrytau_fmu.describing.terminals import icon, icon_svg, terminals_and_icons
from gantrytau_fmu.description import AboutFmu, DefaultExperiment, FmuDescription, FmuInterface, Interfaces

SOLVERS = ("dopri5", "rodas4")
BOTH: tuple[Interfaces, ...] = ("model-exchange", "co-simulation")
RUNTIME = (
    "functions.c tape.c instance.c linear.c past.c solve.c passages.c values.c derivatives.c turns.c impulses.c history.c "
    "initialize.c samples.c events.c state.c {solver}.c step.c calls.c component.c fmi2.c fmi3.c"
)
INCLUDED = ("functions.c", "tape.c", "component.c")  # by others
HEADERS = ("core.h", "calls.h", "fmi2_types.h", "fmi3_types.h")
LARGE = 100_000  # operations from which on the compiler is asked for less; its second level gains nothing


@dataclass(frozen=True)
class Build(AboutFmu):
    """What goes into the file of an FMU beside its model.

    platforms: "native", "all" or names such as "x86_64-windows" (all but "native" need the extra `cross`), () for sources
    alone; sources: put the C sources into the file; experiment: the default experiment, else one of 1 s with the tolerance
    of the FMU; description: else the first line of the class's docstring.
    Raises ModelError for a platform that does not exist.
    """

    platforms: str | Sequence[str] = ("native",)
    sources: bool = True
    experiment: DefaultExperiment | None = None

    def __post_init__(self):
        chosen(self.platforms)


def export_fmu(
    model: Model | Dae,
    path: str | Path,
    *,
    fmi: Literal["3.0", "2.0"] = "3.0",
    interfaces: Sequence[Interfaces] | Interfaces = BOTH,
    solver: Literal["dopri5", "rodas4"] = "dopri5",
    tolerance: float = 1e-6,
    given: Sequence[str] = (),
    find: Sequence[str] = (),
    states: Sequence[str] | None = None,
    build: Build | None = None,
    reference: Result | float | bool | None = None,
) -> Path:
    """Write a model as FMU and return its path.

    fmi: version of the standard; interfaces: "model-exchange", "co-simulation" or both; solver, tolerance: of
    Co-Simulation, explicit or for stiff models; given: known variables instead of the declared inputs, and parameters to
    be kept that else shape the equations; derivatives of given variables that the model needs become inputs, too; find: the
    outputs, else those that the model declares, with all other variables as local ones, else, where none is declared,
    all variables; states: preferred states; build: platforms and what the file says of itself, by default `Build()`.
    Without a compiler a source FMU is written, with a warning. An existing file is replaced when the new one is
    complete. Raises ModelError for wrong arguments, unwritable paths and failed compilations, and what `translate`
    raises. FMI 2.0.4 and 3.0.2.
    reference: reference results to put into the file, by which `check_fmu(..., run=True)` judges it anywhere: a `Result` of
    the model from 0 s on, the time in s until which it is simulated, or True until the end of the experiment, of `build`,
    else the model's, else 1 s. Unless sources are left out, the equations of the DAE are put beside them.
    """
    check_words(export_fmu, {"fmi": fmi, "solver": solver})
    tolerance = number("export_fmu", "tolerance", tolerance, least=1e-12, below=1.0)
    kinds = _interfaces(interfaces)
    about: Build = instance("export_fmu", "build", Build() if build is None else build, Build)
    check_target(path)
    dae = _translated(model, given, find, states)
    about = replace(about, description=about.description or _description(model, dae))
    result = _reference(dae, reference, about, tolerance)
    usual = DefaultExperiment(tolerance=tolerance)
    if result is not None:
        stop = float(result.time[-1])
        usual = replace(usual, stop=stop, step=min(usual.step or stop, stop))
    about = replace(about, experiment=about.experiment or usual)
    request = _Request(fmi, kinds, solver, tolerance, about, reference=result, own=dae)
    return _exported(with_ends_of_tables(dae), find, path, request)


def export_code(
    code: SampledCode, path: str | Path, *, fmi: Literal["3.0", "2.0"] = "3.0", build: Build | None = None
) -> Path:
    """Write the C of a sampled controller as FMU for Co-Simulation and return its path; its variables have the code's names.

    fmi, build: as in `export_fmu`. A step that begins at a sampling instant takes the sample, the first one at the start.
    Saved states hold the controller's memory. Raises ModelError for code in single precision, and what `export_fmu` does.
    """
    check_words(export_code, {"fmi": fmi})
    about: Build = instance("export_code", "build", Build() if build is None else build, Build)
    instance("export_code", "code", code, SampledCode)
    if code.real != "double":
        raise ModelError(
            "expected code in double precision", place="export_code", found=Given("real", code.real)
        )
    check_target(path)
    words = f"{code.name}, a controller in C, sampled every {code.period:g} s"
    about = replace(about, description=about.description or words)
    about = replace(about, experiment=about.experiment or DefaultExperiment(step=code.period))
    dae = translate(_around(code), events=True)
    request = _Request(
        fmi, ("co-simulation",), SOLVERS[0], DefaultExperiment().tolerance or 1e-6, about, code
    )
    return _exported(dae, [f"found_{k}" for k in range(len(code.find))], path, request)


@dataclass(frozen=True)
class _Request:
    """How an FMU is written; code: C that takes its samples, else its formulas do; own: the model as it was given."""

    fmi: Literal["3.0", "2.0"]
    kinds: tuple[Interfaces, ...]
    solver: str
    tolerance: float
    about: Build
    code: SampledCode | None = None
    reference: Result | None = None
    own: Dae | None = None


def _exported(dae: Dae, find: Sequence[str], path: str | Path, request: _Request) -> Path:
    """The file of a translated model."""
    fmi, kinds, solver, tolerance = request.fmi, request.kinds, request.solver, request.tolerance
    about = request.about
    outputs, others = _shown(dae, find)
    graph = entered(formulas_of(dae, [*outputs, *others]))
    contents = contents_of(graph, outputs, others)
    if request.code is not None:
        own = _own_names(request.code)
        contents = contents.renamed(own, request.code.units)
        # in log lines, too
        held = tuple(own[name] for name in graph.formulas.held)
        graph = replace(graph, formulas=replace(graph.formulas, held=held))
    token = _token(graph.formulas, contents, request)
    fmu = _described(graph.formulas, contents, about, token, kinds)
    code = model_code(graph, contents, name=fmu.name, token=token, interfaces=kinds, tolerance=tolerance)
    texts = source_files(_controlled(request.code) + code.text, solver)
    binaries = _compiled(texts, chosen(about.platforms), fmu.identifier, code.operations)
    fmu = replace(fmu if fmi == "3.0" else in_fmi_2(fmu), platforms=tuple(sorted(p.name for p in binaries)))
    if about.sources or not binaries:
        fmu = replace(fmu, sources=(f"sources/{COMPILED}",))
    members = _members(fmu, solver, texts, binaries)
    if request.reference is not None and request.own is not None:
        equations = request.own.equations("base-modelica") if about.sources else ""
        members |= reference_members(fmu, request.reference, equations)
    return write_archive(path, members)


def _reference(
    dae: Dae, reference: Result | float | bool | None, about: Build, tolerance: float
) -> Result | None:
    """The reference results, simulated unless they are given."""
    if reference is None or reference is False:
        return None
    if isinstance(reference, Result):
        for name, value in dae.parameter_values.items():
            if name in reference and not np.allclose(was := reference[name][0], value, rtol=1e-12, atol=0.0):
                words = f"found a result with {name} = {was:g}, expected that of the model, {value:g}; run it anew, or "
                raise ModelError(
                    f"{words}export the model with that value", place="export_fmu", argument="reference"
                )
        return reference
    if reference is True:
        said = about.experiment.stop if about.experiment else dae.flat.experiment.get("StopTime")
        reference = said or DefaultExperiment().stop
    stop = number("export_fmu", "reference", reference, above=0.0, unit="s")
    return simulate(dae, stop=stop, tolerance=min(1e-8, tolerance))


def _interfaces(interfaces: Sequence[Interfaces] | Interfaces) -> tuple[Interfaces, ...]:
    found = (interfaces,) if isinstance(interfaces, str) else tuple(interfaces)
    for one in found or (None,):
        one_of("export_fmu", "interfaces", one, BOTH)
    return tuple(one for one in BOTH if one in found)


def _translated(
    model: Model | Dae, given: Sequence[str], find: Sequence[str], states: Sequence[str] | None
) -> Dae:
    if isinstance(model, Dae):
        if given or states is not None:
            raise ModelError(
                "found a translated model with ",
                Given("given"),
                " or ",
                Given("states"),
                ", expected these where it is translated; give the model itself, or translate(model, given=..., states=...)",
                place="export_fmu",
            )
        return model
    return translate(model, given=given, find=find, states=states, events=True)


def _description(model: Model | Dae, dae: Dae) -> str:
    """The first line of the class's own docstring."""
    text = type(model).__dict__.get("__doc__") if isinstance(model, Model) else None
    return (text or "").strip().partition("\n")[0].rstrip(".") or f"{dae.name}, a model of gantrytau"


def _shown(dae: Dae, find: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Scalar names of the outputs and of local variables."""
    if isinstance(find, str):
        expected = f"expected a list of names; write ['{find}']"
        raise ModelError(expected, place="export_fmu", found=Given("find", find))
    if find:
        return tuple(dict.fromkeys(_found(dae, name) for given in find for name in dae.expand(given))), ()
    known = {*dae.inputs, *(d.name for d in dae.flat.delays)}
    names = [n for n in dict.fromkeys(dae.variables) if n not in known]
    own = {n for v in dae.flat.variables if v.kind == "output" and not v.owner for n in v.elements}
    outputs = tuple(n for n in names if n in own)
    return (outputs, tuple(n for n in names if n not in own)) if outputs else (tuple(names), ())


def _found(dae: Dae, name: str) -> str:
    """A name that can be an output."""
    kind = "a parameter" if name in set(dae.parameters) else "an input" if name in set(dae.inputs) else ""
    if kind:
        raise ModelError(
            f"{name} is {kind} of this FMU, expected variables that it computes; leave it out, "
            f"{kind.split()[1]}s are in the FMU anyway",
            place="export_fmu: find",
            argument="find",
        )
    return name


def _around(code: SampledCode) -> Model:
    """A model with the inputs and outputs of a controller in C, which stands in the place of its sampled formulas."""
    inputs = {f"given_{k}": Input(start=code.starts.get(name, 0.0)) for k, name in enumerate(code.given)}
    outputs = {f"found_{k}": Real(start=0.0) for k in range(len(code.find))}

    def equations(self: Model):
        for name in outputs:
            whole = ca.sum1(ca.vertcat(*(getattr(self, one) for one in inputs)))
            yield sampled(getattr(self, name), whole, period=code.period)

    kind = type(code.name, (Model,), {**inputs, **outputs, "equations": equations, "__module__": __name__})
    return kind()


def _own_names(code: SampledCode) -> dict[str, str]:
    """Names of the FMU's variables by those of the model around it; what is no structured name stands in apostrophes."""
    placed = [f"given_{k}" for k in range(len(code.given))] + [f"found_{k}" for k in range(len(code.find))]
    shown = [n if STRUCTURED.fullmatch(n) else f"'{n}'" for n in (*code.given, *code.find)]
    return dict(zip(placed, shown, strict=True))


def _controlled(code: SampledCode | None) -> str:
    """What stands before model.c: a controller in C, all of it in this one unit."""
    if code is None:
        return ""
    source = code.source.replace('#include "controller.h"', code.header)
    return f"#define CASADI_SYMBOL_EXPORT static\n#define GT_CONTROLLER\n{source}"


def _token(formulas: Formulas, contents: Contents, request: _Request) -> str:
    """The same for the same model: a hash of its formulas and variables, in the form of a UUID."""
    variables = [astuple(variable) for variable in contents.variables]
    text = f"{variables}{request.fmi}{request.solver}{request.tolerance}{formulas.rates}{formulas.residuals}"
    text += _controlled(request.code)
    digits = hashlib.sha256(text.encode()).hexdigest()
    return "{" + "-".join((digits[:8], digits[8:12], digits[12:16], digits[16:20], digits[20:32])) + "}"


def _described(
    formulas: Formulas,
    contents: Contents,
    about: Build,
    token: str,
    kinds: Sequence[str],
) -> FmuDescription:
    """The record of the FMU, in the words of FMI 3, before its binaries are there."""
    name = formulas.dae.name
    identifier = re.sub(r"\W", "_", name, flags=re.ASCII)
    # singular poses are looked for at the end of each step, also of an importer's integrator, as is what turned round,
    # and delays remember it
    watched = bool(formulas.roots or formulas.blocks or formulas.switching.turns or formulas.delays)
    watches = {"model-exchange": {"needsCompletedIntegratorStep": watched}}
    return FmuDescription(
        **{own.name: getattr(about, own.name) for own in fields(AboutFmu)},
        name=name,
        token=token,
        interfaces=tuple(FmuInterface(kind, identifier, watches.get(kind, {})) for kind in kinds),
        variables=contents.variables,
        structure=contents.structure,
        experiment=about.experiment or DefaultExperiment(),
        terminals=contents.terminals,
        generated=datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
    )


def source_files(model: str, solver: str) -> dict[str, str]:
    """All C files of an FMU by name; only fmu.c is compiled, it includes the others."""
    folder = resources.files("gantrytau_fmu") / "runtime"
    names = RUNTIME.format(solver=solver).split()
    found = {n: (folder / n).read_text(encoding="utf-8") for n in (*HEADERS, *names)}
    lines = ["/* The one translation unit of this FMU. */", '#include "core.h"', '#include "model.c"']
    lines += [f'#include "{n}"' for n in names if n not in INCLUDED]
    return {"fmu.c": "\n".join(lines) + "\n", "model.c": model, **found}


def _compiled(
    texts: dict[str, str], targets: Sequence[Platform], identifier: str, operations: int
) -> dict[Platform, bytes]:
    level = "-O1" if operations < LARGE else "-O0"
    try:
        return compile_libraries(texts, platforms=targets, identifier=identifier, optimisation=level)
    except NoCompiler as error:
        warnings.warn(
            f"{error}. The FMU holds C sources only; tools that compile them can use it", stacklevel=3
        )
        return {}


def _members(
    fmu: FmuDescription, solver: str, texts: dict[str, str], binaries: dict[Platform, bytes]
) -> dict[str, bytes]:
    """The files in the archive by their names there."""
    names = sorted(texts) if fmu.sources else []
    members = {"modelDescription.xml": model_description(fmu)}
    members |= binary_members(binaries, fmu.fmi, fmu.identifier)
    members |= {f"sources/{n}": texts[n].encode() for n in names}
    members |= licenses(fmu)
    members["documentation/index.html"] = documentation(fmu, solver)
    if fmu.fmi == "2.0":
        return {**members, "model.png": icon()}
    if names:
        members["sources/buildDescription.xml"] = build_description(fmu, names)
    folder = "terminalsAndIcons/"
    members |= {f"{folder}terminalsAndIcons.xml": terminals_and_icons(fmu), f"{folder}icon.png": icon()}
    return {**members, f"{folder}icon.svg": icon_svg()}
