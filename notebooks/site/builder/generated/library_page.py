"""The page of the Modelica library's examples: what became of each, from `library_results.toml`."""

import statistics
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from notebooks.site.builder.generated.component_tables import table
from notebooks.site.builder.places import SOURCES
from notebooks.site.builder.reading.docstrings import escaped

OPENING = """# Examples of the Modelica Standard Library

`make library-results` reads each example from the library's own text, simulates it with start, stop and tolerance of the
reference, and compares it with the reference trajectories of the Modelica Association. An example has passed when all its
signals stay in a tube: 0.2 % of the range high and 0.2 % of the time wide. Two exceptions are no part of that rule: 1e-6 of
the largest value (or of 1, if that is larger) is noise, and a pulse of the reference that lasts less than a millionth of the
run may be outside, as a flag between the release of a brake and its first motion has no width in exact arithmetic.

Neither the library nor its results come with this project. With both at hand:

```text
MODELICAPATH=... REFERENCE_RESULTS=... make library-results ONLY=Modelica.Mechanics.Rotational
```

Outcomes are kept, so that an interrupted run goes on; `AGAIN=1` runs all anew, `TIME_LIMIT=120` changes the limit of 60 s of
processor time for an example. Where a signal leaves within the first hundredth of the run alone, the beginning is run again
with output times that are as many. Runs go on through singular poses (`singular="cross"`), as those of the reference did.
Times below are processor time: from text to the integration, and the integration.

The tables called `usertab` ask for functions in C. `TestMove` gives a position, a speed and an acceleration that contradict
each other; derivatives are those of the position here, as the annotation `derivative` of functions is not read. In
`TestFriction` a flag of the reference is up for 1.8e-6 s before the motion begins.

The start of `FullRobot` leaves open how motors and frictions at rest share the weight of the arms: the reference gives all
of it to the motors, a start here divides it.

Of libraries of others, without reference results, the examples are run and no more: those that came to the end of their
annotation `experiment` "ran". `MODELICAPATH=folder:folder_of_Modelica make library-results ONLY=PlanarMechanics`.
"""
PEER = """A sample of each package, as far as it was run, simulated by {name} on the same machine ({date}): the same
start, stop, tolerance and output times, compared in the same tubes. Times are processor time of all threads. {name} runs all
examples in one session, which keeps what it has read; here each has a process of its own, which reads what it needs.

```text
RUMOCA=python_that_imports_rumoca MODELICAPATH=... REFERENCE_RESULTS=... python -m tests.library_results.peer
```
"""
WORDS = ("passed", "left", "refused", "not run", "no reference", "ran")
HEAD = ("package", "examples", *WORDS, "translate, s", "simulate, s", "library", "date")


def library_page() -> str:
    """The page in Markdown."""
    read = tomllib.loads((SOURCES / "library_results.toml").read_text(encoding="utf-8"))
    packages = read["package"]
    text = f"{OPENING}\n## By package\n\n{table('', HEAD, list(map(_row, packages)))}\n\n## What did not pass\n\n"
    wrong = [
        (f"`{one['name']}`", one["word"], escaped(one["detail"]))
        for package in packages
        for one in package["example"]
        if one["word"] not in ("passed", "ran")
    ]
    text += f"{table('', ('example', '', 'first signal that leaves, or message'), wrong)}\n"
    ours = {one["name"]: one for package in packages for one in package["example"]}
    return text + "".join(_beside(peer, ours) for peer in read.get("peer", []))


def _beside(peer: Mapping[str, Any], ours: Mapping[str, Mapping[str, Any]]) -> str:
    """The sample that another program simulated beside the same examples here."""
    pairs = [(ours[one["name"]], one) for one in peer["example"] if one["name"] in ours]
    both = [pair for pair in pairs if all(one["word"] == "passed" for one in pair)]
    words = [sum(pair[side]["word"] == "passed" for pair in pairs) for side in (0, 1)]
    medians = {
        stage: [_median(pair[side][stage] for pair in both) for side in (0, 1)]
        for stage in ("translate", "simulate")
    }
    told = [f"median s to {stage} {here} and {there}" for stage, (here, there) in medians.items()]
    rows = [
        (f"`{a['name']}`", a["word"], *_times(a), b["word"], *_times(b), escaped(b["detail"]))
        for a, b in pairs
    ]
    head = ("example", "here", "translate, s", "simulate, s", peer["name"], "translate, s", "simulate, s", "")
    return (
        f"\n## Beside {peer['name']} {peer['version']}\n\n{PEER.format(name=peer['name'], date=peer['date'])}\n"
        f"Passed: {words[0]} of {len(pairs)} here, {words[1]} by {peer['name']}. "
        f"Of the {len(both)} that both pass: {', '.join(told)}.\n\n{table('', head, rows)}\n"
    )


def _times(one: Mapping[str, Any]) -> tuple[str, str]:
    if one["word"] not in ("passed", "left"):
        return "", ""
    return f"{one['translate']:.2g}", f"{one['simulate']:.2g}"


def _row(package: Mapping[str, Any]) -> Sequence[str]:
    examples = package["example"]
    held = [one for one in examples if one["word"] in ("passed", "ran")]
    counts = [str(sum(one["word"] == word for one in examples)) for word in WORDS]
    times = [_median(one[stage] for one in held) for stage in ("translate", "simulate")]
    return (f"`{package['name']}`", str(len(examples)), *counts, *times, package["library"], package["date"])


def _median(seconds: Iterable[float]) -> str:
    values = list(seconds)
    return f"{statistics.median(values):.2g}" if values else ""
