"""How a problem is to be solved: the keywords of `optimize` as one record, checked when it is made."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, Literal, TypedDict

from gantrytau import ModelError, Result
from gantrytau.border.checks import check_words, instance, number, whole
from gantrytau.border.refusal import Given, did_you_mean
from gantrytau.compiler.system import Causality
from gantrytau_optimica.answers.answer import Answer
from gantrytau_optimica.solving.clock import Progress
from gantrytau_optimica.solving.ipopt import SolverSettings
from gantrytau_optimica.transcription.mesh import Mesh, mesh_of
from gantrytau_optimica.transcription.scheme import Collocation
from gantrytau_optimica.transcription.transcribe import METHODS, MOST_POINTS, Scheme

Guesses = Mapping[str, Any] | Result | Answer


class MeshKeywords(TypedDict, total=False):
    """Keywords of `optimize` that `estimate` has as well."""

    elements: int | Sequence[float]
    points: int
    scheme: Scheme
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
    compile: bool


@dataclass(frozen=True, eq=False)
class Policy:
    """The keywords of `optimize`, explained there. Raises ModelError for values that cannot be."""

    elements: int | Sequence[float] = 50
    points: int = 3
    scheme: Scheme = "radau"
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
    compile: bool = True

    def __post_init__(self):
        check_words(Policy, vars(self), "")
        limits: dict[str, dict[str, Any]] = {
            "tolerance": {"above": 0.0, "below": 1.0},
            "max_time": {"unit": "s", "above": 0.0, "most": math.inf},
        }
        limits |= {} if self.refine is None else {"refine": {"least": 1e-9, "below": 1.0}}
        for name, these in limits.items():
            object.__setattr__(self, name, number("", name, getattr(self, name), **these))
        for name in ("max_iterations", "starts"):
            whole("", name, getattr(self, name), least=1)
        whole("", "points", self.points, least=METHODS[self.scheme].least, most=MOST_POINTS)
        if self.progress is not None:
            instance("", "progress", self.progress, Callable, "a function of (iteration, objective)")
        scheme = Given("scheme", self.scheme)
        for found in (Given("refine", self.refine), Given("lengths", self.lengths)):
            if found.value not in (None, "given") and not self.transcription.refinable:
                raise ModelError(
                    scheme, " has inputs in pieces of whole elements, expected another one", found=found
                )
        if self.points == 1 and self._ramps:
            raise ModelError(
                "expected at least 2: one point does not determine inputs that are ramps",
                found=Given("points", 1),
            )
        self.mesh  # noqa: B018 - refuses what is no mesh

    @property
    def _ramps(self) -> bool:
        """Whether inputs are to be straight lines in each element."""
        wanted = self.controls.values() if isinstance(self.controls, Mapping) else ()
        return self.refine is not None or any(one in ("ramps", {"kind": "ramps"}) for one in wanted)

    @cached_property
    def transcription(self) -> Collocation:
        """Points and weights in every element, and what may be done with the program."""
        return replace(METHODS[self.scheme].scheme(self.points), compiled=self.compile)

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
    try:
        return Policy(**keywords)
    except ModelError as error:
        raise error.within(verb) from None
