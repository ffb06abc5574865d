"""What is said of a fit of rods: how exact it is, and its numbers with their standard deviations."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from gantrytau import Description
from gantrytau.describing.described import Listing
from gantrytau.describing.short_values import cut
from gantrytau_optimica.calibration.links.error_models import COMMON, shared_name

COLUMNS = ("name", "value", "standard deviation", "unit")
LONG = 200  # letters of a list of names


def calibration_described(found: Any, name: str = "") -> Description:
    """What is said of a fit, or of one parameter of it; ModelError for a name that is not there."""
    deviations = found.deviations
    if name:
        found.parameters[name]  # an unknown name raises
        _, *told = _row(found, name, deviations)
        facts = tuple(zip(COLUMNS[1:], told, strict=True))
        return Description(name, f"parameter of {found.robot_name}", "", tuple(f for f in facts if f[1]))
    facts = [
        ("fitted", f"{len(found.rows)} poses, {len(found.names)} numbers of rank {found.rank}"),
        (
            "held out",
            f"{len(found.held_out)} poses, {found.error * 1e6:.3g} um from those foretold, in the mean",
        ),
        ("ended", f"{'solved' if found.success else 'without success'} in {found.iterations} steps"),
    ]
    facts += [("not held by the data", cut(", ".join(found.undetermined), LONG))] * bool(found.undetermined)
    facts += [("finding", str(one)) for one in found.findings]
    rows = [_row(found, n, deviations) for n in found.parameters]
    title = f"Calibration of {found.robot_name}"
    return Description(title, "", "", tuple(facts), (Listing.of("Parameters", COLUMNS, rows),))


def _row(found: Any, name: str, deviations: Mapping[str, float]) -> tuple[str, str, str, str]:
    """A number or a vector, as many digits as are known of a length in um."""
    value = np.asarray(found.parameters[name], dtype=float)
    elements = [name] if value.ndim == 0 else [f"{name}[{k}]" for k in range(value.size)]
    sure = [deviations.get(shared_name(e, deviations)) for e in elements]
    told = [f"{x:.7g}" for x in np.atleast_1d(value).ravel()]
    known = [one for one in sure if one is not None]
    return name, _joined(told), _joined([f"{one:.2g}" for one in known]), _unit(name)


def _joined(texts: list[str]) -> str:
    return texts[0] if len(texts) == 1 else f"[{', '.join(texts)}]" if texts else ""


def _unit(name: str) -> str:
    if name.endswith("rotation"):
        return "rad"
    return "" if name.endswith((COMMON, "orientation")) else "m"
