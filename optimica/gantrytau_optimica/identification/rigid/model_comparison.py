"""The same motion explained by several models of a robot: `compare`, and the four of Table 6.3."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gantrytau import Model, ModelError, translate
from gantrytau_optimica.identification.logs.motion_log import MotionLog
from gantrytau_optimica.identification.rigid.identification import Identification
from gantrytau_optimica.identification.rigid.identify import identify


@dataclass(frozen=True, eq=False)
class ModelComparison:
    """Fits by the name of their model; prints itself as a table."""

    fits: Mapping[str, Identification]

    @property
    def totals(self) -> dict[str, float]:
        """Sums of squares over all joints, N2, by model."""
        return {name: float(np.sum(fit.squares)) for name, fit in self.fits.items()}

    @property
    def ranking(self) -> tuple[str, ...]:
        """Models from the least to the largest sum of squares."""
        return tuple(sorted(self.totals, key=self.totals.__getitem__))

    def __str__(self) -> str:
        names = list(dict.fromkeys(n for fit in self.fits.values() for n in fit.parameters))
        width = max(map(len, (*names, "sum of squares, N2")))
        lines = [f"{'':{width}s} " + " ".join(f"{name:>14s}" for name in self.fits)]
        for name in names:
            numbers = (fit.parameters.get(name) for fit in self.fits.values())
            lines.append(
                f"{name:{width}s} "
                + " ".join(f"{'' if x is None else format(x, '.5g'):>14s}" for x in numbers)
            )
        lines.append(
            f"{'sum of squares, N2':{width}s} " + " ".join(f"{x:14.4g}" for x in self.totals.values())
        )
        return "\n".join(lines)


def compare(
    robot: Model, log: MotionLog | Sequence[MotionLog], models: Mapping[str, Mapping[str, Any]]
) -> ModelComparison:
    """Identify a robot from the same logs with several models.

    models: by name, the keywords of `identify`, such as {"no links": dict(fixed=dict(link_masses=0))}. Raises ModelError
    for no model, and as `identify`.
    """
    if not models:
        raise ModelError(
            "compare: found no models, expected keywords of identify by name; see printed_models"
        )
    dae = translate(robot)
    fits = {name: identify(dae, log, **keywords) for name, keywords in models.items()}
    return ModelComparison({name: replace(fit, nominal=robot) for name, fit in fits.items()})


def printed_models(coulomb: Any, viscous: Any) -> dict[str, dict[str, Any]]:
    """The four models of Table 6.3 of Dressler (2012): keywords of `identify` by number.

    coulomb, viscous: of an earlier friction experiment, (n, 2) in N and kg/s at positive and at negative speed. All leave
    out the masses of the links; 1 has no viscous friction, 2 has all, 3 takes all friction of the experiment, 4 its
    viscous friction.
    """
    given = {
        "1": dict(viscous=0.0),
        "2": {},
        "3": dict(coulomb=coulomb, viscous=viscous),
        "4": dict(viscous=viscous),
    }
    return {name: dict(fixed=dict(link_masses=0.0) | fixed) for name, fixed in given.items()}
