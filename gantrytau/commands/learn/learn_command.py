"""`gantrytau learn`: a robot that learns a motion from run to run, in several ways, as a file describes them."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from gantrytau import GantryTauError
from gantrytau.commands.arguments.option import printing, serves
from gantrytau.commands.arguments.options import Json
from gantrytau.commands.printing.reporting import INTERRUPTED, answered, fail, note, refusing, reporting
from gantrytau_optimica import learn_cases, read_rig
from gantrytau_optimica.learning import RIG_EXAMPLE, LearntCases, plot_learning

PICTURES = ("errors", "input", "path")
NAMES = {"history": "--output", "learning": "learning", "limit": "open_to", "reference": "reference"} | {
    "window": "learning.window"
}


@serves(learn_cases, force=typer.Option("--force", help="Learn what would diverge, too."))
def learn(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="The rig, as rig.toml; --example prints one.", show_default=False
        ),
    ],
    force: bool,
    case: Annotated[
        list[str] | None,
        typer.Option("--case", metavar="NAME", help="Only this case; repeatable.", show_default=False),
    ] = None,
    iterations: Annotated[
        int | None, typer.Option(help="The number of the last run.", show_default="as the file says")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help="Of what differs from run to run.", show_default="as the file says")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            help="Keep histories, corrections (CSV) and pictures there; the same command goes on with the rest.",
            show_default=False,
        ),
    ] = None,
    example: Annotated[
        bool,
        typer.Option(
            "--example", help="Print a file to begin with.", is_eager=True, callback=printing(RIG_EXAMPLE)
        ),
    ] = False,
    json: Json = False,
) -> None:
    """Learn a motion from run to run, and compare ways to learn it.

    What corrections do is measured first; what would diverge is refused before the first run.
    """
    with reporting(json, None, NAMES):
        with refusing():
            rig = read_rig(file).changed(iterations=iterations, seed=seed, names=tuple(case or ()))
        if output is not None:
            output.mkdir(parents=True, exist_ok=True)
        tell = None if json else lambda words: note(f"{words} ...")
        with _interrupts(output, json):
            found = learn_cases(rig, folder=output, force=force, progress=tell)
        files = [] if output is None else kept(found, output)
        cases = (f"Case {name}. {history}\n" for name, history in found.histories.items())
        answered(
            json, {"cases": summary(found), "fitted": found.fitted}, "\n".join([*cases, str(found)]), files
        )


@contextmanager
def _interrupts(folder: Path | None, json: bool) -> Iterator[None]:
    """Ctrl-C says where the runs are that were finished."""
    try:
        yield
    except (KeyboardInterrupt, GantryTauError) as error:
        first: BaseException = error  # runs tell of Ctrl-C as errors of their own, with what they have
        while first.__cause__ is not None:
            first = first.__cause__
        if not isinstance(first, KeyboardInterrupt):
            raise
        where = (
            "nothing was written; --output keeps runs as they are finished"
            if folder is None
            else f"finished runs are kept in {folder}, and the same command goes on from them"
        )
        fail(f"Interrupted; {where}", INTERRUPTED, json)


def kept(found: LearntCases, folder: Path) -> list[Path]:
    """Corrections and pictures of all cases beside their histories, and the files."""
    files = []
    for name, history in found.histories.items():
        files += [
            folder / f"case-{name}.npz",
            history.save_corrections(folder / f"case-{name}-corrections.csv"),
        ]
        for what in PICTURES:
            history.plot(what, file=folder / f"case-{name}-{what}.png")
            files.append(folder / f"case-{name}-{what}.png")
    plot_learning(found.histories, file=folder / "cases.png")
    return [*files, folder / "cases.png"]


def summary(found: LearntCases) -> list[dict[str, Any]]:
    """What was learnt as a record for programs: errors in % of the first run, run by run."""
    return [
        {
            "name": name,
            "learns": list(history.names),
            "sigma": None if history.stability is None else history.stability.sigma,
            "relative": history.relative,
            "tool": history.tool_relative[:, list(history.reference.moving)],
            "settled": found.settled(name)[list(history.reference.moving)],
        }
        for name, history in found.histories.items()
    ]
