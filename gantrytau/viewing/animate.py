"""`view` and `animate`: a model in a pose, or a motion, as one page for any browser."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gantrytau.dae import Dae, translate
from gantrytau.errors import ModelError
from gantrytau.language.model import Model
from gantrytau.results.result import Result
from gantrytau.viewing.motion import motion_of
from gantrytau.viewing.page import Page, page

FileName = str | os.PathLike[str]


def view(
    model: Model | type[Model] | Dae, pose: Mapping[str, Any] | None = None, *, file: FileName | None = None
) -> Page:
    """A model in a pose, as one page that needs no network and shows itself in a notebook.

    pose: values of variables, as of `Dae.evaluate`, `{"tool.r": [0.5, 2.8, -0.8]}`; what it leaves open is as at the start.
    file: where the page is saved, too. Components of `mechanics.multibody` are seen; a method `shapes()` says of one's own what
    they look like. Raises ModelError for what cannot be shown, InitializationError for a pose that cannot be.
    """
    dae = model if isinstance(model, Dae) else translate(model)
    values = dae.evaluate(dict(pose or {}))
    constants = {name: float(value) for name, value in dae.parameter_values.items()}
    pose_only = Result([0.0], {**constants, **_scalars(values)}, title=dae.name, shapes=dae.flat.shapes)
    return _kept(Page(page([motion_of(pose_only)], [""], dae.name), dae.name), file)


def animate(
    shown: Any, *, file: FileName | None = None, speed: float = 1.0, names: Sequence[str] | None = None
) -> Page:
    """A result of `simulate`, or an optimum, in motion; a list of them stands side by side, under `names`.

    file: where the page is saved, too; speed: seconds of the motion in one second. Forces of joints that slide are arrows, the
    way of the tool is a line, and a part turns red while something of it is at its limit, which optima tell. Pictures follow one
    another 60 times a second, more slowly where there would be more than 1800. Raises ModelError for what cannot be shown.
    """
    together = list(shown) if isinstance(shown, (list, tuple)) else [shown]
    if not together:
        raise ModelError("animate: found an empty list, expected results of simulate or optimize")
    if names is not None and len(names) != len(together):
        raise ModelError(
            f"animate: found {len(names)} names for {len(together)} results, expected one for each"
        )
    motions = [motion_of(one, speed) for one in together]
    titles = list(names) if names is not None else [m.title if len(motions) > 1 else "" for m in motions]
    if len(set(titles)) < len(titles):
        titles = [f"{title} ({k + 1})" for k, title in enumerate(titles)]
    if len(motions) > 1:  # at one clock
        step = min(motion.step for motion in motions)
        motions = [replace(m, step=step, times=_at_clock(m.times, step * speed)) for m in motions]
    title = ", ".join(dict.fromkeys(motion.title for motion in motions))
    return _kept(Page(page(motions, titles, title), title), file)


def _at_clock(times: np.ndarray, step: float) -> np.ndarray:
    """Times (N,) of pictures from the first to the last, `step` s apart."""
    return np.append(np.arange(times[0], times[-1] - 1e-3 * step, step), times[-1])


def _scalars(values: Mapping[str, Any]) -> dict[str, float]:
    """Scalars by name of values that may be arrays."""
    found = {}
    for name, value in values.items():
        array = np.asarray(value, dtype=float)
        if array.ndim == 0:
            found[name] = float(array)
        for index in np.ndindex(*array.shape) if array.ndim else ():
            found[f"{name}[{','.join(map(str, index))}]"] = float(array[index])
    return found


def _kept(made: Page, file: FileName | None) -> Page:
    return made if file is None else replace(made, file=made.save(file))
