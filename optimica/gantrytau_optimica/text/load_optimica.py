"""`load_optimica`: Optimica text as optimisation problems."""

import os
from collections.abc import Iterable
from typing import Any

from gantrytau.modelica.elaboration.classes import class_of
from gantrytau.modelica.elaboration.library import ModelicaLibrary, loaded
from gantrytau.modelica.elaboration.structure import Structure
from gantrytau_optimica.text.text_problem import TextOptimization


class OptimicaLibrary(ModelicaLibrary):
    """Classes of Optimica text: `library["Package.Optimization"]` is an Optimization, a model is a Model."""

    kinds = ("optimization", *ModelicaLibrary.kinds)

    def class_of(self, structure: Structure) -> type[Any]:
        if structure.scope.definition.kind == "optimization":
            return class_of(structure, TextOptimization)
        return super().class_of(structure)


def load_optimica(
    *paths: str | os.PathLike[str], libraries: Iterable[str | os.PathLike[str]] = ()
) -> OptimicaLibrary:
    """The classes of Optimica and Modelica files; each optimization is an Optimization, `optimize(library["P.Fastest"])`.

    paths: `.mop` and `.mo` files, and folders of packages; libraries: as for `load_modelica`. `x(finalTime)` is a value at a
    time, `free=true` what the optimiser chooses, min and max of variables hold at all times. Raises ModelError with file,
    line and column.
    """
    return loaded(OptimicaLibrary, "load_optimica('vdp.mop')", paths, libraries)
