"""The links of each model brought to their minima."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gantrytau_optimica.calibration.data.measurements import Measurements, thinned
from gantrytau_optimica.calibration.fitting.priors import with_prior
from gantrytau_optimica.calibration.fitting.rod_fit import Fit, fit_group, fit_groups
from gantrytau_optimica.calibration.links.closure import Chain
from gantrytau_optimica.calibration.links.error_models import (
    COMMON,
    ModelLink,
    elements,
    grouped,
    needs_rails,
    on_rail,
    own_directions,
    parallel,
    started_linear,
)
from gantrytau_optimica.calibration.links.groups import Group

# rad, between nominal guideways and identified ones, from which on the frame is another
ANOTHER_FRAME = 0.005

Fitted = Callable[[Sequence[Group]], list[Fit]]  # groups at their minima, with prior, loss and certainty


def fit_model(
    model: object,
    links: list[ModelLink],
    data: Measurements,
    *,
    start: str,
    prior: Mapping[str, Any] | None,
    nominal: Mapping[str, float],
    loss: str,
) -> list[Fit]:
    """The fits of a model of Table 5.2, of groups of links that share parameters; start, prior, loss: as of `calibrate`;
    nominal: values by name, about which deviations of the prior hold parameters.
    """

    def fitted(groups: Sequence[Group]) -> list[Fit]:
        return fit_groups(with_prior(groups, prior, nominal), loss, data.certainty)

    if needs_rails(model):
        return _fit_rails(model, links, data, fitted)
    if model == "parallel":
        return _fit_parallel(links, start, fitted)
    return fitted(grouped([own_directions(link) for link in links] if model == 3 else links))


def _fit_parallel(links: list[ModelLink], start: str, fitted: Fitted) -> list[Fit]:
    """One direction for all guideways: the nominal one, unless it is unknown or that of another frame."""
    common = fitted(grouped(parallel(links, True)))
    found = common[0].values
    identified = np.array([found[name] for name in elements(COMMON)])
    nominal = np.mean([link.start[4:7] for link in links], axis=0)
    cosine = identified @ nominal / np.linalg.norm(identified) / np.linalg.norm(nominal)
    if start == "linear" or np.arccos(np.clip(cosine, -1, 1)) > ANOTHER_FRAME:
        return common
    return fitted(grouped(parallel(links, False)))


def _fit_rails(model: object, links: list[ModelLink], data: Measurements, fitted: Fitted) -> list[Fit]:
    """Models 2, 4 and 5: first where straight guideways lie, then how the measured ones do."""
    assert data.rails is not None
    single = [link for link in links if link.chain.R is None]
    if not single:  # models 4 and 5 turn guideways as model 2 finds them
        single = started_linear([_without_plate(cart, links) for cart in range(len(data.rails))])
    fits = [fit_group(group) for group in grouped(single)]
    single = [_at(link, fit) for link, fit in zip(single, fits, strict=True)]
    placed = [_placed(k, data.rails[k.cart], fit.smallest) for k, fit in zip(single, fits, strict=True)]
    if model == 2:
        return fitted([fit.group.started(fit.x) for fit in placed])
    whole: list[ModelLink] = []
    for link in links:
        own = own_directions(link)
        if model == 4 or link.cart == 1:
            fit = placed[link.cart]
            guideway = fit.group.chains[0]
            assert isinstance(guideway, Chain)  # models with measured guideways have no turntables
            turned = guideway.frame(fit.x[fit.group.places[0]])
            started = _at(own, fit_group(grouped([own])[0]))
            whole += on_rail(started, data.rails[link.cart], turned)
        else:
            whole.append(own)
    return fitted(grouped(whole))


def _placed(link: ModelLink, rail: np.ndarray, truncated: float) -> Fit:
    """The measured guideway where a link has it; how it is rolled is tried with some of the poses.

    truncated: as of the straight guideway.
    """
    few = thinned(len(link.chain.q))
    assert isinstance(link.chain, Chain)  # models with measured guideways have no turntables
    trials = on_rail(replace(link, chain=link.chain.at(few)), rail)
    fits = [fit_group(grouped([trial])[0], smallest=truncated) for trial in trials]
    best = int(np.argmin([f.minimum.cost if np.isfinite(f.minimum.cost) else np.inf for f in fits]))
    if len(few) == len(link.chain.q):
        return fits[best]
    return fit_group(grouped([on_rail(link, rail)[best]])[0].started(fits[best].x))


def _without_plate(cart: int, links: Sequence[ModelLink]) -> ModelLink:
    link = next(link for link in links if link.cart == cart)
    names = (f"{link.arm}.length", *elements(f"{link.arm}.offset"), *link.names[4:7])
    parts = {part: getattr(link, part)[:7] for part in ("start", "free", "scale")}
    return replace(link, chain=replace(link.chain, name=link.arm, R=None), names=names, **parts)


def _at(link: ModelLink, fit: Fit) -> ModelLink:
    return replace(link, start=np.array([fit.values[name] for name in link.names]))
