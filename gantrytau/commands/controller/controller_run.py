"""`gantrytau controller run`: a plant, a controller and clients, sample by sample, as a file describes them."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Literal

import typer

from gantrytau import SolveError
from gantrytau.commands.arguments.option import printing
from gantrytau.commands.arguments.options import Json
from gantrytau.commands.controller.controller_file import EXAMPLE, read_controller
from gantrytau.commands.printing import result_output
from gantrytau.commands.printing.reporting import INTERRUPTED, answered, reporting
from gantrytau_fmu.controller import Controller

LINES = ".jsonl"
NAMES = {"log": "--output", "timeout": "--wait"}


def run(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="The controller, as cell.toml; --example prints one.", show_default=False
        ),
    ],
    stop: Annotated[float, typer.Option(help="Time at which to stop, in s.", show_default=False)],
    clock: Annotated[
        Literal["virtual", "wall"] | None,
        typer.Option(
            help="virtual goes as fast as it can, wall waits for every period.",
            show_default="as the file says",
        ),
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
    example: Annotated[
        bool,
        typer.Option(
            "--example", help="Print a file to begin with.", is_eager=True, callback=printing(EXAMPLE)
        ),
    ] = False,
    json: Json = False,
) -> None:
    """Run a controller whose references others overwrite, and tell what became of the samples.

    Ctrl-C ends it at the next sample; what was run until then is kept.
    """
    with reporting(json, None, NAMES):
        lines = output is not None and output.suffix == LINES
        saved = None if lines else output
        result_output.rehearse(saved)
        controller = read_controller(file, clock)
        with _served(controller, port, wait):
            try:
                result = controller.run(stop, log=output if lines else None)
            except SolveError as error:
                result_output.stop(error, saved, json)
        files = [str(output)] if lines else result_output.save(result, saved)
        record = {
            "time": {"stop": result.time[-1], "samples": result.time.size},
            "ended": result.ended,
            "timing": result.timing.as_record(),
            "final": {name: result.final(name) for name in result.names},
        }
        early = "" if result.ended == "stop" else f"\nEnded at {result.time[-1]:g} s: {result.ended}"
        answered(json, record, f"{result.timing}{early}", files)
        if result.ended == "interrupted":
            raise typer.Exit(INTERRUPTED)


@contextmanager
def _served(controller: Controller, port: int | None, wait: float) -> Iterator[None]:
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
