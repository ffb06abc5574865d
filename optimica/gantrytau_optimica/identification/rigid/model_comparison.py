"""The same motion explained by several models of a robot: `compare_models`, and those of Table 6.3."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from gantrytau import Model, ModelError, translate
from gantrytau.dae import Dae
from gantrytau.describing.record import Record
from gantrytau_optimica.identification.logs.motion_log import MotionLog
from gantrytau_optimica.identification.rigid.identification import Identification
from gantrytau_optimica.identification.rigid.identify import identify


@dataclass(frozen=True, eq=False)
class ModelComparison(Record):
    """Fits by the name of their model; prints itself as a table, with numbers of others in brackets.

    beside: by model and name such numbers, sums of squares as "total" in N2.
    """

    fits: Mapping[str, Identification]
    beside: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

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
        lines = [f"{'':{width}s} " + " ".join(f"{name:>18s}" for name in self.fits)]
        for name in names:
            numbers = {model: fit.parameters.get(name) for model, fit in self.fits.items()}
            lines.append(f"{name:{width}s} {self._row(numbers, name)}")
        lines.append(f"{'sum of squares, N2':{width}s} {self._row(self.totals, 'total')}")
        weak = "; ".join(f"{model}: {', '.join(fit.weak)}" for model, fit in self.fits.items() if fit.weak)
        return "\n".join([*lines, *([f"weak in {weak}"] if weak else [])])

    def _row(self, numbers: Mapping[str, float | None], name: str) -> str:
        cells = []
        for model, number in numbers.items():
            other = self.beside.get(model, {}).get(name)
            cell = "" if number is None else f"{number:.4g}"
            cells.append(f"{cell if other is None else f'{cell} [{other:.4g}]':>18s}")
        return " ".join(cells)


def compare_models(
    robot: Model | Dae,
    log: MotionLog | Sequence[MotionLog],
    models: Mapping[str, Mapping[str, Any]],
    *,
    beside: Mapping[str, Mapping[str, float]] | None = None,
) -> ModelComparison:
    """Identify a robot, or what `translate` made of it, from the same logs with several models.

    models: by name, the keywords of `identify`, such as {"no links": dict(fixed=dict(link_masses=0))}; beside: numbers to
    print in brackets, such as TABLE_6_3. Raises ModelError for no model, and as `identify`.
    """
    if not models:
        raise ModelError(
            "compare_models: found no models, expected keywords of identify by name; see printed_models"
        )
    dae = robot if isinstance(robot, Dae) else translate(robot)
    nominal = None if isinstance(robot, Dae) else robot
    fits = {name: replace(identify(dae, log, **words), nominal=nominal) for name, words in models.items()}
    return ModelComparison(fits, beside or {})


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


FURTHER_MODELS = {  # which the text beside Table 6.3 rules out: links whose masses may be negative, or not; asymmetry
    "links": dict(physical=False),
    "links >= 0": {},
    "asymmetric": dict(fixed=dict(link_masses=0.0), friction="asymmetric"),
}


def _printed(
    total: float, plate: float, carts: str, coulomb: str = "", viscous: str = ""
) -> dict[str, float]:
    families = {"cart_masses": carts, "coulomb": coulomb, "viscous": viscous}
    numbers = {f"{word}[{i}]": float(x) for word, row in families.items() for i, x in enumerate(row.split())}
    return {"plate_mass": plate, "total": total} | numbers


TABLE_6_3 = {  # as printed; sums of squares, N2, over its own motion, which is not known
    "1": _printed(5.42e7, 8.76, "14.33 14.05 38.10", "152.13 259.09 291.24"),
    "2": _printed(3.37e7, 9.13, "13.58 13.64 38.23", "128.62 145.13 194.57", "102.43 355.25 388.77"),
    "3": _printed(7.22e7, 8.79, "13.85 14.85 38.47"),
    "4": _printed(4.02e7, 9.67, "12.51 12.73 37.70", "109.97 207.13 243.75"),
}
