"""Estimated values as modifications of the model, for `--set` of all commands."""

import re
from typing import Any

from gantrytau import parameter_text
from gantrytau.commands.estimate.estimate_file import EstimateFile
from gantrytau_optimica import Estimate


def set_values(asked: EstimateFile, found: Estimate) -> dict[str, Any]:
    """Name -> value of the parameters that are the same in all experiments; a vector is a list, a matrix its rows."""
    values: dict[str, Any] = {}
    for name in asked.parameters:
        if name in found.parameters:
            values[name] = found.parameters[name]
            continue
        whole = next(p for p in asked.flat.parameters if p.name == name)
        rows, columns = (*whole.shape, 1)[:2]
        numbers = [found.parameters[element] for element in whole.elements]
        values[name] = (
            numbers if len(whole.shape) == 1 else [numbers[row::rows][:columns] for row in range(rows)]
        )
    return values


def _key(name: str) -> str:
    """A name as TOML writes keys."""
    return name if re.fullmatch(r"[\w-]+", name, re.ASCII) else f'"{name}"'


def own_names(asked: EstimateFile, found: Estimate) -> list[str]:
    """Numbers that belong to single experiments: their starts, and parameters of their own."""
    shared = {
        n for name in asked.parameters for p in asked.flat.parameters if name == p.name for n in p.elements
    }
    return [name for name in found.parameters if name not in shared and name not in asked.parameters]


def values_text(asked: EstimateFile, found: Estimate, values: dict[str, Any]) -> str:
    """A file for `--set`, with deviations and what belongs to single experiments as comments."""
    chosen = asked.chosen
    whose = f"{chosen.name}({chosen.prototype})" if chosen.prototype else chosen.name
    deviations = found.deviations
    count = len(found.experiments)
    lines = [f"estimated from {found.errors.size} values of {count} experiment{'s' if count > 1 else ''}:"]
    for name, value in found.parameters.items():
        sure = f"deviation {deviations[name]:.3g}" if name in deviations else "at its limit"
        own = ", of an experiment" if name in own_names(asked, found) else ""
        lines.append(f"  {name} = {value:.9g}, {sure}{own}")
    lines += [f"Note: {words}" for words in found.warnings]
    return parameter_text({_key(name): value for name, value in values.items()}, whose, "\n".join(lines))
