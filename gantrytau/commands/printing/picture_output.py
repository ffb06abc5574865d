"""Drawing a result on the command line: to a file, or in a window where there is a display."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gantrytau import Result, Study, has_windows
from gantrytau.commands.printing.reporting import CommandError, refusing, writable

if TYPE_CHECKING:
    from gantrytau_optimica import Optimum

WINDOW = "window"


def place(drawn: tuple[str, ...], to: str | None) -> str | None:
    """Where to draw, by default in a window, or None if nothing is drawn; CommandError if that cannot be."""
    if to is not None and not drawn:
        raise CommandError(
            f"--to {to}: found no names to draw, expected some; add --plot NAMES, or leave it out"
        )
    if not drawn:
        return None
    rehearse(to or WINDOW)
    return to or WINDOW


def rehearse(to: str | None, option: str = "--to") -> None:
    """CommandError if there is no window to draw in, or no picture of that format or in that folder; None is none."""
    import matplotlib

    if to is None:
        return

    if to == WINDOW:
        import matplotlib.pyplot as plt

        if not has_windows(plt.get_backend()):
            raise CommandError(
                f"{option} window: no window can be opened here (Matplotlib draws with '{plt.get_backend()}'). "
                f"Write a picture with {option} picture.png, or work where there is a display (ssh -X) "
                "and a window toolkit is installed (pip install pyqt6)"
            )
        return
    from matplotlib.backend_bases import FigureCanvasBase

    matplotlib.use("agg")  # a picture needs no display
    file, formats = Path(to), FigureCanvasBase.get_supported_filetypes()
    if file.suffix.removeprefix(".").lower() not in formats:
        raise CommandError(
            f"{option} {to}: found the suffix '{file.suffix}', expected 'window' or a picture: "
            f"{', '.join(f'.{name}' for name in sorted(formats))}"
        )
    if not file.parent.is_dir():
        raise CommandError(f"{option} {to}: the folder '{file.parent}' does not exist; create it first")


def draw(
    result: "Result | Optimum | Study", names: tuple[str, ...], to: str, display: Any = None
) -> list[str]:
    """Draw the variables, in units as `display` says; the files written."""
    return shown(partial(result.plot, *names, display=display), to)


def shown(plot: Callable[..., Any], to: str | None, option: str = "--plot") -> list[str]:
    """Draw by a function of `file=`, which is None for a window; the files written, none where nothing is drawn."""
    if to is None:
        return []
    if to != WINDOW:
        with writable(Path(to)), refusing(f"{option} "):
            plot(file=to)
        return [to]
    import matplotlib.pyplot as plt

    plot(file=None)
    plt.show()
    return []
