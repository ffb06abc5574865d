"""The panel on a terminal: a table that is renewed, and lines that the operator enters."""

import threading
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from gantrytau.border.refusal import ModelError
from gantrytau_fmu.controller.board import STATES
from gantrytau_fmu.controller.panel.panel_link import PanelLink

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

HELP = "idle | submit | obtain | set NAME VALUE ... | quit"
RATE = 5.0  # Hz, of the table


def panel_table(link: PanelLink) -> "Table":
    """All values of a controller, and where it is."""
    from rich.table import Table
    from rich.text import Text

    where = f"sample {link.k}, {link.time:.3f} s" if link.k >= 0 else "no sample yet"
    if link.ended:
        where += f"; ended: {link.ended}"
    elif link.k >= 0 and not link.live:
        where += "; no samples come"
    # texts as they are: brackets in names are no styles
    title, caption = Text(f"Controller {link.place}: {where}"), Text(HELP if link.token else "")
    table = Table(title=title, title_justify="left", caption=caption)
    table.add_column("name")
    table.add_column("value", justify="right")
    table.add_column("unit")
    values = link.values
    for channel in link.published:
        found = values.get(channel.name, [])
        text = "  ".join(f"{value:.6g}" for value in found)
        if channel.name == "state":
            text = link.state
        style = "bold" if channel.name in link.parameters else ""
        unit = "" if channel.unit == "1" else channel.unit
        table.add_row(Text(channel.name), Text(text), Text(unit), style=style)
    return table


def obey(link: PanelLink, line: str) -> bool:
    """Do what a line says; whether the panel goes on. ModelError for a line that says nothing of the kind."""
    words = line.split()
    if not words:
        return True
    verb, *rest = words
    if verb in ("quit", "q", "exit") and not rest:
        return False
    if verb in STATES and not rest:
        link.switch(verb)
    elif verb == "set" and len(rest) >= 2:
        try:
            values = [float(word.removesuffix(",")) for word in rest[1:]]
        except ValueError:
            raise ModelError(f"found {' '.join(rest[1:])!r}, expected numbers, as 1.5 or 1e-3") from None
        link.set(rest[0], values)
    else:
        raise ModelError(f"found {line.strip()!r}, expected {HELP}")
    return True


def terminal_panel(link: PanelLink, console: "Console", lines: Iterable[str]) -> None:
    """Show a controller until it ends or a line says quit; lines: what the operator enters, in a thread of its own."""
    from rich.live import Live
    from rich.text import Text

    end, said = threading.Event(), [""]

    def read() -> None:
        for line in _until_closed(lines):
            try:
                said[0] = ""
                if not obey(link, line):
                    end.set()
                    return
            except ModelError as error:
                said[0] = str(error)

    reader = threading.Thread(target=read, name="operator", daemon=True)
    reader.start()
    with Live(panel_table(link), console=console, refresh_per_second=RATE, transient=False) as live:
        while not end.wait(1 / RATE):
            table = panel_table(link)
            if said[0]:
                table.caption = Text(f"{said[0]}\n{HELP}")
            live.update(table)
            if link.ended:
                return


def _until_closed(lines: Iterable[str]) -> Iterator[str]:
    """Lines until there are no more, or nobody can read them."""
    try:
        yield from lines
    except (OSError, ValueError):
        return
