"""`gantrytau controller run`: a plant, a controller and clients, sample by sample, as a file describes them."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gantrytau import SolveError
from gantrytau.commands.arguments.options import Json
from gantrytau.commands.controller.controller_file import EXAMPLE, read_controller
from gantrytau.commands.printing import result_output
from gantrytau.commands.printing.reporting import INTERRUPTED, CommandError, as_json, reporting
from gantrytau.commands.printing.spelling import Spelling

if TYPE_CHECKING:
    from gantrytau_fmu.controller import ControlledResult, Controller

LINES = ".jsonl"
SPELLING = Spelling(
    ("controller",),
    {"stop": "--stop", "clock": "--clock", "log": "--output", "port": "--port", "timeout": "--wait"},
)


def run(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE", help="The controller, as cell.toml; --example prints one.", show_default=False
        ),
    ] = None,
    stop: Annotated[
        float | None, typer.Option(help="Time at which to stop, in s.", show_default=False)
    ] = None,
    clock: Annotated[
        str | None,
        typer.Option(help="virtual, as fast as it goes, or wall.", show_default="as the file says"),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            help="Keep all samples: .jsonl, a line each as they are taken; or .csv, .nc, .mat, .parquet at the end.",
            show_default=False,
        ),
    ] = None,
    port: Annotated[
        int | None,
        typer.Option(
            help="Let clients and panels come over the network; 0 takes a free port.", show_default=False
        ),
    ] = None,
    wait: Annotated[
        float,
        typer.Option(
            help="Time in s in which clients with places in the file have to come; 0: they may come later."
        ),
    ] = 30.0,
    example: Annotated[bool, typer.Option("--example", help="Print a file to begin with.")] = False,
    json: Json = False,
) -> None:
    """Run a controller whose references others overwrite, and tell what became of the samples.

    Ctrl-C ends it at the next sample; what was run until then is kept.
    """
    with reporting(json, None, SPELLING):
        if example:
            typer.echo(EXAMPLE, nl=False)
            return
        if file is None or stop is None:
            raise CommandError(
                f"found no {'FILE' if file is None else '--stop'}, expected both: "
                "gantrytau controller run cell.toml --stop 10"
            )
        if clock not in (None, "virtual", "wall"):
            raise CommandError(f"--clock {clock}: expected virtual or wall")
        lines = output is not None and output.suffix == LINES
        saved = None if lines else output
        result_output.rehearse(saved)
        controller = read_controller(file, clock)
        with _served(controller, port, wait):
            try:
                result = controller.run(stop, log=output if lines else None)
            except SolveError as error:
                result_output.stop(error, SPELLING, saved, json)
        files = [str(output)] if lines else result_output.save(result, saved)
        told = summary(result, files)
        if json:
            typer.echo(as_json(told))
        else:
            _show(result, files)
        if result.ended == "interrupted":
            raise typer.Exit(INTERRUPTED)


@contextmanager
def _served(controller: "Controller", port: int | None, wait: float) -> Iterator[None]:
    """A controller that serves at a port, if it is to; closed again whatever happens."""
    if port is None:
        yield
        return
    with controller.serve(port) as server:
        typer.echo(
            f"Serving at {server.host}:{server.port}; to set something: --token {server.token}", err=True
        )
        if wait:
            server.wait(timeout=wait)
        yield


def summary(result: "ControlledResult", files: list[str]) -> dict[str, Any]:
    """What was run as a record for programs."""
    return {
        "time": {"stop": result.time[-1], "samples": result.time.size},
        "ended": result.ended,
        "timing": result.timing.as_record(),
        "final": {name: result.final(name) for name in result.names},
        "files": files,
    }


def _show(result: "ControlledResult", files: list[str]) -> None:
    typer.echo(str(result.timing))
    if result.ended != "stop":
        typer.echo(f"Ended at {result.time[-1]:g} s: {result.ended}")
    for file in files:
        typer.echo(f"Written: {file}")
