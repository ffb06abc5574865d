"""A page that asks this program for each pose: its sliders move a model whose loops are closed as they move."""

import html
import time
import webbrowser
from collections.abc import Mapping
from contextlib import ExitStack
from threading import Lock
from typing import Any, Self

import numpy as np

from gantrytau.border.refusal import InitializationError, ModelError, did_you_mean
from gantrytau.border.units import Scale, given, known_scale
from gantrytau.viewing.page import quiet_server, staged
from gantrytau.viewing.sliders import Posing
from gantrytau.viewing.solids import solids

NOTHING = "Each pose is computed as it is asked for."


class LivePage:
    """A model with sliders on a page that this program serves, to this machine only, until `stop` or its end.

    url: where the page is. `show` opens it, `set` moves sliders, `pose` says where they stand, `why` why that cannot be,
    `wait` serves until Ctrl-C. In a notebook it shows itself. As a context manager it stops by itself.
    """

    def __init__(self, posing: Posing):
        self._posing, self._lock, self._open = posing, Lock(), ExitStack()
        self._told = {one["name"]: one for one in posing.shown()}
        self._assembly = next(iter(posing.daes))
        found = posing.found(self._assembly, posing.ends)
        if not np.isfinite(found[0]).all():
            raise InitializationError(posing.why(self._assembly, posing.ends[0]))
        found = found[np.isfinite(found).all(axis=1)]
        self._server = self._open.enter_context(quiet_server())
        self._players = staged(self._server, [posing.film(found)], [""])
        self._last, self.why = found[:1], ""
        self._build()

    @property
    def url(self) -> str:
        """Where the page is."""
        return f"http://127.0.0.1:{self._server.get_port()}"

    @property
    def pose(self) -> dict[str, float]:
        """Values of the sliders by name, in SI."""
        return {name: float(self._scale(name).si(handle.value)) for name, handle in self._handles.items()}

    def set(self, values: Mapping[str, Any]) -> None:
        """Move sliders to values, within their ranges. Raises ModelError for other names."""
        found: dict[str, float] = {}
        for name, value in values.items():
            if name not in self._handles:
                raise ModelError(f"view: found no slider {name}{did_you_mean(name, self._handles)}")
            own = self._posing.dae.flat.unit(name)
            found[name] = self._scale(name).written(float(given(f"view: {name}", value, own)))
        for name, shown in found.items():
            handle = self._handles[name]
            handle.value = float(np.clip(shown, handle.min, handle.max))
        self._move()

    def show(self) -> None:
        """Open the page in the browser."""
        webbrowser.open(self.url)

    def wait(self) -> None:
        """Serve until Ctrl-C."""
        try:
            while True:
                time.sleep(0.5)
        except KeyboardInterrupt:
            self.stop()

    def stop(self) -> None:
        """End serving; the page stays as it is where it is open."""
        self._open.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _repr_html_(self) -> str:
        return f'<iframe src="{html.escape(self.url)}" style="width:100%;height:540px;border:0"></iframe>'

    def __repr__(self) -> str:
        return f"<LivePage {self._posing.dae.name}: {self.url}>"

    def _build(self) -> None:
        """Put the sliders, the choice of assemblies and what is said on the page."""
        gui = self._server.gui
        gui.configure_theme(show_logo=False, show_share_button=False)
        gui.main_panel.dock_right()
        gui.set_panel_label(self._posing.dae.name)
        self._handles = {}
        for name, one in self._told.items():
            low, high = one["values"][0], one["values"][-1]
            label = f"{name} [{one['unit']}]" if one["unit"] not in ("", "1") else name
            handle = gui.add_slider(
                label, low, high, (high - low) / 1000, one["values"][one["start"]], hint=one["words"] or None
            )
            handle.on_update(lambda _: self._move())
            self._handles[name] = handle
        if len(self._posing.daes) > 1:
            choice = gui.add_dropdown("configuration", tuple(self._posing.daes))

            def choose(_: Any) -> None:
                self._assembly = choice.value
                self._move()

            choice.on_update(choose)
        self._said = gui.add_markdown(NOTHING)

    def _scale(self, name: str) -> Scale:
        own = self._posing.dae.flat.unit(name) or "1"
        return known_scale(f"view: {name}", self._told[name]["unit"] or own, own)

    def _move(self) -> None:
        """Show the pose at the sliders, or the last one that could be, in red."""
        with self._lock:
            row = np.array(list(self.pose.values()))
            found = self._posing.found(self._assembly, row[None])
            wrong = not np.isfinite(found).all()
            self.why = self._posing.why(self._assembly, row) if wrong else ""
            self._last = self._last if wrong else found
            film = self._posing.film(self._last, np.array([wrong]))
            with self._server.atomic():
                for player, solid in zip(self._players, solids(film), strict=True):
                    player.put(film, solid)
            self._said.content = (
                f"**This pose cannot be; the last one that could is red.** {self.why}" if wrong else NOTHING
            )
