"""How a problem is to be solved: the keywords of `optimize` as one record, checked when it is made."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, Literal, TypedDict

import numpy as np

from gantrytau import ModelError, Result
from gantrytau.border.refusal import did_you_mean
from gantrytau.compiler.system import Causality
from gantrytau_optimica.answers.answer import Answer
from gantrytau_optimica.solving.clock import Progress
from gantrytau_optimica.solving.ipopt import SolverSettings
from gantrytau_optimica.transcription.mesh import Mesh, mesh_of
from gantrytau_optimica.transcription.scheme import Collocation, collocation

Guesses = Mapping[str, Any] | Result | Answer


class MeshKeywords(TypedDict, total=False):
    """Keywords of `optimize` that `estimate` has as well."""

    elements: int | Sequence[float]
    points: int
    scheme: str
    tolerance: float
    max_iterations: int
    max_time: float
    progress: Progress | None


class TranscriptionKeywords(MeshKeywords, total=False):
    """Keywords of `optimize` that `pareto` has as well."""

    lengths: Literal["given", "free"]
    guess: Guesses | None
    controls: Mapping[str, Any] | None
    causality: Causality | None


class PolicyKeywords(TranscriptionKeywords, total=False):
    """Keywords of `optimize` that `prepare` has as well: all but `record`."""

    refine: float | None
    starts: int


@dataclass(frozen=True, eq=False)
class Policy:
    """The keywords of `optimize`, explained there. Raises ModelError for values that cannot be."""

    elements: int | Sequence[float] = 50
    points: int = 3
    scheme: str = "radau"
    lengths: Literal["given", "free"] = "given"
    guess: Guesses | None = None
    controls: Mapping[str, Any] | None = None
    causality: Causality | None = None
    refine: float | None = None
    starts: int = 1
    tolerance: float = 1e-8
    max_iterations: int = 1000
    max_time: float = 300.0
    progress: Progress | None = None

    def __post_init__(self):
        accuracy, told = self.refine, self.progress
        for name, holds, expected in (
            ("tolerance", isinstance(self.tolerance, float) and 0 < self.tolerance < 1, "a number between 0 and 1"),
            ("max_iterations", _whole(self.max_iterations), "a whole number of at least 1"),
            ("max_time", isinstance(self.max_time, (int, float)) and self.max_time > 0, "seconds above 0"),
            ("progress", told is None or callable(told), "a function of (iteration, objective)"),
            ("refine", accuracy is None or (isinstance(accuracy, float) and 1e-9 <= accuracy < 1),
             "a relative accuracy from 1e-9 to below 1, as 1e-6"),
            ("causality", self.causality in (None, "inverse", "forward"), "'inverse', 'forward' or None, the better one"),
            ("starts", _whole(self.starts), "a whole number of at least 1"),
            ("lengths", self.lengths in ("given", "free"),
             "'given' or 'free' (the optimiser places the borders of the elements)"),
        ):  # fmt: skip
            if not holds:
                raise ModelError(f"{name}={getattr(self, name)!r}: expected {expected}", argument=name)
        if self.shooting and self.refine is not None:
            said = "refine and scheme='shooting' do not go together; use scheme='radau' or 'gauss'"
            raise ModelError(said, argument="refine")
        if self.collocation.points.size == 1 and self._ramps:
            said = "points=1 does not determine inputs that are ramps, as with refine=; expected at least 2 points"
            raise ModelError(said, argument="points")
        self.mesh  # noqa: B018 - refuses what is no mesh

    @property
    def shooting(self) -> bool:
        """Whether elements have steps instead of collocation points."""
        return self.scheme == "shooting"

    @property
    def _ramps(self) -> bool:
        """Whether inputs are to be straight lines in each element."""
        wanted = self.controls.values() if isinstance(self.controls, Mapping) else ()
        return self.refine is not None or any(one in ("ramps", {"kind": "ramps"}) for one in wanted)

    @cached_property
    def collocation(self) -> Collocation:
        """Points and weights in every element."""
        return collocation("radau" if self.shooting else self.scheme, self.points)

    @cached_property
    def mesh(self) -> Mesh:
        """The elements of a phase."""
        return mesh_of(self.elements, self.lengths == "free")

    @property
    def solver(self) -> SolverSettings:
        """How long and how closely Ipopt is to look."""
        return SolverSettings(self.tolerance, self.max_iterations, self.max_time, self.progress)

    @property
    def given(self) -> dict[str, Any]:
        """What is recorded of a run: all but who is told of its progress."""
        return {f.name: getattr(self, f.name) for f in fields(self) if f.name != "progress"}


def policy_of(verb: str, kind: type, keywords: Mapping[str, Any]) -> Policy:
    """The policy that the keywords of a verb say. TypeError for those that are not of this kind, as Python's own."""
    for name in keywords:
        if name not in kind.__annotations__:
            raise TypeError(
                f"{verb}() got an unexpected keyword argument '{name}'{did_you_mean(name, kind.__annotations__)}"
            )
    return Policy(**keywords)


def _whole(value: Any) -> bool:
    return not isinstance(value, bool) and isinstance(value, (int, np.integer)) and bool(value >= 1)
