"""`view` and `animate`: a model in a pose, or a motion, as one page for any browser."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np

from gantrytau.border.checks import instance, number
from gantrytau.border.refusal import Given, ModelError
from gantrytau.dae import Dae, translate
from gantrytau.language.model import Model
from gantrytau.progress import shows_progress
from gantrytau.results.result import Result

if TYPE_CHECKING:
    from gantrytau.viewing.film import Film
    from gantrytau.viewing.live import LivePage
    from gantrytau.viewing.page import Page

FileName = str | os.PathLike[str]
Shown = Model | type[Model] | Dae


@overload
def view(
    model: Shown,
    pose: Mapping[str, Any] | None = None,
    *,
    file: FileName | None = None,
    around: Sequence[Any] = (),
    sliders: Any = None,
    configurations: Mapping[str, Mapping[str, Any]] | None = None,
    live: Literal[False] = False,
) -> "Page": ...
@overload
def view(
    model: Shown,
    pose: Mapping[str, Any] | None = None,
    *,
    file: FileName | None = None,
    around: Sequence[Any] = (),
    sliders: Any = None,
    configurations: Mapping[str, Mapping[str, Any]] | None = None,
    live: Literal[True],
) -> "LivePage": ...
@shows_progress
def view(
    model: Shown,
    pose: Mapping[str, Any] | None = None,
    *,
    file: FileName | None = None,
    around: Sequence[Any] = (),
    sliders: Any = None,
    configurations: Mapping[str, Mapping[str, Any]] | None = None,
    live: bool = False,
) -> "Page | LivePage":
    """A model in a pose, as one page that needs no network and shows itself in a notebook.

    pose: values of variables, as of `Dae.evaluate`, `{"tool.r": [0.5, 2.8, -0.8]}`; what it leaves open is as at the start.
    file: where the page is saved, too; around: obstacles, as `Box` of `gantrytau.kinematics`, and a workspace. Components of
    `mechanics.multibody` are seen; a method `shapes()` says of one's own what they look like.
    sliders: variables and parameters that are moved on the page, by names or with their ranges, {"crank.phi": ("-90 deg",
    "90 deg"), "crank.length": None}, up to four, or True for the coordinates that are states; loops close at all choices of
    them, which are computed before. What cannot be is red and says why. configurations: start values of other assemblies by
    name, {"elbow up": {"rod.phi": 1.2}}, to choose from. live: each pose is computed when it is asked for, by this program,
    for any number of sliders; see `LivePage`.
    Raises ModelError for what cannot be shown, InitializationError for a pose that cannot be.
    """
    from gantrytau.viewing.film import film_of, scalars_of

    dae = _translated(model)
    instance("view", "pose", pose, (Mapping, type(None)), "values by name, {'tool.r': [0.5, 2.8, -0.8]}")
    if sliders is not None or configurations or live:
        from gantrytau.viewing.sliders import Posing, poses_page

        posing = Posing(dae, True if sliders is None else sliders, dict(pose or {}), configurations, around)
        if live:
            from gantrytau.viewing.live import LivePage

            if file is not None:
                words = "expected none: a live page is served, not saved"
                raise ModelError(words, place="view", found=Given("file", file))
            return LivePage(posing)
        return _saved(poses_page(posing), dae.name, file)
    values = dae.evaluate(dict(pose or {}))
    constants = {name: float(value) for name, value in dae.parameter_values.items()}
    pose_only = Result(
        [0.0], {**constants, **dict(scalars_of(values))}, title=dae.name, shapes=dae.flat.shapes
    )
    return _page([film_of(pose_only, model=dae, around=around)], [""], dae.name, file)


@shows_progress
def animate(
    shown: Any,
    *,
    file: FileName | None = None,
    speed: float = 1.0,
    names: Sequence[str] | None = None,
    around: Sequence[Any] = (),
    model: Shown | None = None,
) -> "Page":
    """What `simulate`, `optimize`, `plan_calibration` or a closed loop found, in motion; lists stand side by side.

    names: of those in a list; file: where the page is saved, too; speed: seconds of the motion in one second; around:
    obstacles and a workspace, as of `view`; model: whose motion it is, of a result that was read from a file. Forces of
    actuators are arrows, the way of the tool a line, and a part turns red while something of it is at its limit, in optima.
    Beside a closed loop is a ghost, seen through: where the plan of each sample ends. Pictures follow one another 60 times a
    second, more slowly where there would be more than 1800. Raises ModelError for what cannot be shown.
    """
    from gantrytau.viewing.film import film_of

    speed = number("animate", "speed", speed, above=0.0)
    together = list(shown) if isinstance(shown, (list, tuple)) else [shown]
    if not together:
        raise ModelError("animate: found an empty list, expected results of simulate or optimize")
    if names is not None and (isinstance(names, str) or len(names) != len(together)):
        raise ModelError(
            f"expected a list of texts, one for each of {len(together)} results",
            place="animate",
            found=Given("names", names),
        )
    dae = None if model is None else _translated(model)
    films = [film_of(one, speed, dae, around) for one in together]
    titles = (
        [str(name) for name in names]
        if names is not None
        else [f.title if len(films) > 1 else "" for f in films]
    )
    if len(set(titles)) < len(titles):
        titles = [f"{title} ({k + 1})" for k, title in enumerate(titles)]
    title = ", ".join(dict.fromkeys(film.title for film in films))
    return _page(_at_one_clock(films, speed), titles, title, file)


def _translated(model: Shown) -> Dae:
    if isinstance(model, Dae):
        return model
    if not (isinstance(model, Model) or (isinstance(model, type) and issubclass(model, Model))):
        raise ModelError(
            f"view: found {type(model).__name__}, expected a model, or what translate made of it; animate(...) shows results"
        )
    found: Any = model  # a class is instantiated there
    return translate(found, events=True)


def _at_one_clock(films: "Sequence[Film]", speed: float) -> "list[Film]":
    """Motions whose pictures follow one another at the same rate, the fastest of theirs; what ends earlier waits."""
    step = min((film.step for film in films if film.step > 0), default=0.0)
    if len(films) == 1 or step == 0:
        return list(films)
    return [_every_step(film, step, speed) for film in films]


def _every_step(film: "Film", step: float, speed: float) -> "Film":
    """A motion, and its ghost, with pictures `step` s apart on the page."""
    ghost = None if film.ghost is None else _every_step(film.ghost, step, speed)
    return replace(film, step=step, times=_every(step * speed, film.times), ghost=ghost)


def _every(step: float, times: np.ndarray) -> np.ndarray:
    """Times (N,) from the first to the last, `step` s apart."""
    return np.append(np.arange(times[0], times[-1] - 1e-3 * step, step), times[-1])


def _page(films: "Sequence[Film]", names: Sequence[str], title: str, file: FileName | None) -> "Page":
    from gantrytau.viewing.page import page

    return _saved(page(films, names, title), title, file)


def _saved(text: str, title: str, file: FileName | None) -> "Page":
    from gantrytau.viewing.page import Page

    made = Page(text, title)
    return made if file is None else replace(made, file=made.save(file))
