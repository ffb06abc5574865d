"""documentation/ of an FMU: one page for who receives it without the toolkit, and its licences.

FMI 3.0.2, section 2.5.1.1; FMI 2.0.4, section 2.3: index.html is the entry, licenses/license.txt that of the licences.
"""

from collections.abc import Iterable
from contextlib import suppress
from html import escape
from importlib.metadata import PackageNotFoundError, version
from itertools import groupby

from gantrytau.describing.pages import folded, page, table
from gantrytau_fmu.describing.description_checks import initial_of, limit
from gantrytau_fmu.describing.license import BSD_3_CLAUSE
from gantrytau_fmu.describing.xml_text import plain
from gantrytau_fmu.description import FmuDescription, FmuVariable

MANY = 300  # outputs; more of them are grouped by component and folded
STYLE = "table { width: 100%; }"
SOLVERS = {
    "dopri5": "DOPRI5, the explicit Runge-Kutta method 5(4) of Dormand and Prince with adaptive steps",
    "rodas4": "Rodas4, a linearly implicit (Rosenbrock) method of order 4 with adaptive steps, for stiff models",
}
FIXED = "set before the start"  # of parameters that are fixed afterwards
KINDS = {"model-exchange": "Model Exchange", "co-simulation": "Co-Simulation"}


def documentation(fmu: FmuDescription, solver: str = "dopri5") -> bytes:
    """documentation/index.html: what the model is, what it needs, its variables, how to use it; no scripts.

    solver: of Co-Simulation, as `export_fmu` calls it.
    """
    name = _text(fmu.name)
    parts = [
        f"<h1>{name}</h1>",
        f"<p>{_text(fmu.description)}</p>" if fmu.description else "",
        _facts(fmu),
        _needs(),
        _variables(fmu),
        _solution(fmu, solver),
        _use(fmu),
        _license(fmu),
    ]
    return page(plain(fmu.name), parts, STYLE).encode()


def licenses(fmu: FmuDescription) -> dict[str, bytes]:
    """Licence texts by their path in the archive, the same in FMI 2 and 3.

    The entry, license.txt, tells the licence of the model, which is its author's, from that of the runtime.
    """
    model = fmu.license or "none was stated; ask the author of the model"
    owner = [line for line in (fmu.author and f"Author: {fmu.author}", fmu.copyright) if line]
    text = "\n".join(
        [
            f"Licences of the FMU {plain(fmu.name)}",
            "",
            "1. The model",
            *owner,
            f"Licence: {model}",
            "",
            "2. The runtime: the C code that answers the FMI functions and integrates, in sources/ and binaries/",
            "Licence: BSD-3-Clause, see gantrytau.txt",
            "",
            "3. The C code of the equations, sources/model.c",
            "It was written by gantrytau from the model, and is part of the model: the licence of the model holds for it.",
            "",
        ]
    )
    folder = "documentation/licenses/"
    return {folder + "license.txt": text.encode(), folder + "gantrytau.txt": BSD_3_CLAUSE.encode()}


def _text(text: str) -> str:
    return escape(plain(text), quote=False)


def _facts(fmu: FmuDescription) -> str:
    kinds = " and ".join(KINDS[each.kind] for each in fmu.interfaces)
    rows = {
        "FMI": f"{fmu.fmi}, {kinds}",
        "Version": fmu.version,
        "Author": fmu.author,
        "Copyright": fmu.copyright,
        "Made with": ", ".join(filter(None, (_tool(fmu.tool), fmu.generated))),
        "Token": fmu.token,
    }
    return table((), ((name, plain(value)) for name, value in rows.items() if value))


def _tool(name: str) -> str:
    """The tool with its version, if it is installed here."""
    with suppress(PackageNotFoundError, ValueError):
        return f"{name} {version(name)}"
    return name


def _needs() -> str:
    return (
        "<h2>What it needs</h2>\n<p>Nothing but the C and mathematics library of the operating system: no Python, no "
        "toolkit, no licence server, no network. The platforms are the folders of <code>binaries/</code>; where "
        "<code>sources/</code> is there, the one file <code>fmu.c</code> compiles with any C99 compiler for others. "
        "It may be instantiated any number of times, also in threads.</p>"
    )


def _variables(fmu: FmuDescription) -> str:
    variables, states = fmu.variables, [fmu.by_name[name] for name in fmu.states]
    outputs = [v for v in variables if v.causality == "output"]
    hidden = sum(v.causality == "local" for v in variables) - sum(v.causality == "local" for v in states)
    parts = [
        _section("Inputs", [v for v in variables if v.causality == "input"]),
        _section("Outputs", outputs) if len(outputs) <= MANY else _grouped("Outputs", outputs),
        _section("Parameters", [v for v in variables if v.causality == "parameter"]),
        _section("States", states),
        f"<p>Local variables besides: {hidden}, listed in <code>modelDescription.xml</code>.</p>"
        if hidden
        else "",
    ]
    return "\n".join(filter(None, parts))


def _section(title: str, variables: list[FmuVariable]) -> str:
    if not variables:
        return ""
    return f"<h2>{title} ({len(variables)})</h2>\n" + _variable_table((v.name, v) for v in variables)


def _grouped(title: str, variables: list[FmuVariable]) -> str:
    """Outputs by component, elements of a vector on one row, folded."""
    groups: dict[str, list[FmuVariable]] = {}
    for variable in variables:
        groups.setdefault(_component(variable.name), []).append(variable)
    parts = [f"<h2>{title} ({len(variables)}), by component</h2>"]
    for component, members in groups.items():
        summary = f"{_text(component)} ({len(members)})"
        parts.append(folded(summary, [_variable_table(_neighbours(members))]))
    return "\n".join(parts)


def _component(name: str) -> str:
    """The part of the model a variable belongs to: "carts[0]" for "der(carts[0].s)"."""
    inner = name.removeprefix("der(")
    return inner.split(".")[0] if "." in inner and "'" not in inner else "the model itself"


def _neighbours(variables: list[FmuVariable]) -> Iterable[tuple[str, FmuVariable]]:
    """Neighbours that differ by their last index only, as one row: "tool.r[0] ... [2]"."""
    for _, group in groupby(
        variables, lambda v: (_base(v.name), v.unit, v.description, v.type, v.variability)
    ):
        members = list(group)
        name = members[0].name
        yield (
            (name if len(members) == 1 else f"{name} ... {members[-1].name[len(_base(name)) :]}"),
            members[0],
        )


def _base(name: str) -> str:
    place = name.rfind("[")
    return name[:place] if place > 0 and name.rstrip(")").endswith("]") else name


def _variable_table(rows: Iterable[tuple[str, FmuVariable]]) -> str:
    head = ("Name", "Unit", "Start", "Limits", "Description")
    return table(head, ((plain(name), plain(v.unit), _start(v), _limits(v), _note(v)) for name, v in rows))


def _start(variable: FmuVariable) -> str:
    if variable.start is None or initial_of(variable) == "calculated":
        return ""
    return f"{variable.start:.9g}" + (" (guess)" if initial_of(variable) == "approx" else "")


def _limits(variable: FmuVariable) -> str:
    low, high = limit(variable.min), limit(variable.max)
    if low is None:
        return "" if high is None else f"≤ {high:.9g}"
    return f"≥ {low:.9g}" if high is None else f"{low:.9g} to {high:.9g}"


def _note(variable: FmuVariable) -> str:
    fixed = FIXED if (variable.causality, variable.variability) == ("parameter", "fixed") else ""
    return "; ".join(filter(None, (plain(variable.description), fixed)))


def _solution(fmu: FmuDescription, solver: str) -> str:
    told = fmu.experiment
    count = len(fmu.states)
    parts = [f"States: {count}; event indicators: {fmu.indicators}."]
    if fmu.has("co-simulation") and count:
        parts.append(
            f"Co-Simulation integrates with {SOLVERS[solver]}; relative tolerance {told.tolerance:g} unless the "
            "importer sets another. Inputs are held during a step."
        )
    parts.append("Directional derivatives are exact; states can be saved, restored and serialised.")
    return "<h2>Solution</h2>\n<p>" + " ".join(parts) + "</p>"


def _use(fmu: FmuDescription) -> str:
    told, file = fmu.experiment, f"{fmu.identifier}.fmu"
    adjustable = any(v.causality == "parameter" and v.variability == "tunable" for v in fmu.variables)
    listed = [
        f"Import <code>{file}</code> in a tool that reads FMI {fmu.fmi}, such as Simulink, Dymola, OpenModelica or FMPy.",
        f"Default experiment: {told.start:g} s to {told.stop:g} s"
        + (f", step {told.step:g} s." if fmu.has("co-simulation") else "."),
        "Parameters are set before initialisation"
        + (
            f"; all but those that are marked &ldquo;{FIXED}&rdquo; may be changed at any time later, too."
            if adjustable
            else "."
        ),
        "A call that fails logs why and names the variable, in the categories <code>logStatusError</code> and "
        "<code>logStatusWarning</code>; <code>logEvents</code> and <code>logCalls</code> tell more.",
    ]
    items = "".join(f"<li>{item}\n" for item in listed)
    return f"<h2>How to use it</h2>\n<ul>\n{items}</ul>\n<pre>{escape(_script(fmu), quote=False)}</pre>"


def _script(fmu: FmuDescription) -> str:
    """A run in FMPy, with the first parameter set and the first input given, which is held over the run."""
    told = fmu.experiment
    known = next((v for v in fmu.variables if v.causality == "input" and v.real), None)
    chosen = next((v for v in fmu.variables if v.causality == "parameter" and v.start is not None), None)
    lines = ["from fmpy import simulate_fmu"]
    arguments = [f"{f'{fmu.identifier}.fmu'!r}", f"stop_time={told.stop:g}"]
    if told.start:
        arguments.insert(1, f"start_time={told.start:g}")
    if fmu.has("co-simulation"):
        arguments.append(f"output_interval={told.step:g}")
    if chosen:
        arguments.append(f"start_values={{{chosen.name!r}: {chosen.start!r}}}")
    if known:
        value = limit(known.start) or 0.0
        lines += [
            "import numpy as np",
            f"given = np.array([({told.start:g}, {value!r}), ({told.stop:g}, {value!r})],  # times in s and values",
            f"                 dtype=[('time', float), ({known.name!r}, float)])",
        ]
        arguments.append("input=given")
    call = ",\n                      ".join(arguments)
    return "\n".join([*lines, f"result = simulate_fmu({call})"])


def _license(fmu: FmuDescription) -> str:
    model = _text(fmu.license) or "none stated"
    link = '<a href="licenses/license.txt">licenses/license.txt</a>'
    return f"<h2>Licence</h2>\n<p>Model: {model}. Runtime: BSD-3-Clause. See {link}.</p>"
