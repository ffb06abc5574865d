"""A translated model with its answers: what `translate` returns."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import cached_property
from typing import Any, Literal

import casadi as ca

from gantrytau.answers.causality import function
from gantrytau.answers.described_dae import dae_described
from gantrytau.answers.diagnosis import Diagnosis, diagnose
from gantrytau.answers.evaluation import evaluate
from gantrytau.answers.instant_function import instant_function, is_before
from gantrytau.answers.many_points.array_function import ArrayFunction
from gantrytau.compiler.request import Request, names
from gantrytau.compiler.start.other_starts import with_starts
from gantrytau.compiler.system import Causality, System, assemble
from gantrytau.compiler.translated import Translated
from gantrytau.compiler.translation import translate_flat
from gantrytau.describing.described import Description
from gantrytau.flattening.check_units import check_units
from gantrytau.flattening.flat_checks import refuse_events
from gantrytau.flattening.flat_model import FlatModel
from gantrytau.flattening.flatten import flatten
from gantrytau.language.model import Model
from gantrytau.progress import timed
from gantrytau.writing import write_equations


class Dae(Translated):
    """A translated model, made by `translate`: functions, consistent points, written equations, the equation system."""

    @classmethod
    def of(cls, translated: Translated) -> "Dae":
        """A Dae of a record of translation."""
        return cls(**{f.name: getattr(translated, f.name) for f in fields(Translated)})

    def __describe__(self, name: str = "") -> Description:
        return dae_described(self, name)

    def _repr_html_(self) -> str:
        return self.__describe__().html()

    @cached_property
    def diagnosis(self) -> Diagnosis:
        """Sizes, mobility, loops, states, blocks and the start; prints itself."""
        return diagnose(self)

    def system(
        self, form: Literal["explicit", "lifted"] = "explicit", causality: Causality | None = None
    ) -> System:
        """The equations as x' = ode(t, x, z, u, p), 0 = residuals(t, x, z, u, p).

        form: "explicit" inserts all closed forms, and z has the other unknowns. "lifted" keeps square roots and torn
        unknowns in z with equations of their own, which optimisers prefer.
        causality: of the lifted form. "inverse" has accelerations in z, from which reactions and inputs follow; "forward"
        has the unknowns that remain when the equations are solved for accelerations. The default is "inverse" where there
        is no closed form forwards and "inverse" leaves fewer unknowns. Raises ModelError for "inverse" where inputs and
        accelerations do not match.
        """
        return assemble(self, form, causality)

    def equations(self, format: Literal["text", "latex", "html", "base-modelica"] = "text") -> str:
        """The equations, written out: every block with the component equations it comes from, or the flat model.

        text: one line per solved unknown; latex: align environments to be included in a document (amsmath);
        html: one page by component, by block, and a table of quantities; base-modelica: the flat model as a class
        that Modelica tools read. With find= of `translate`, all but base-modelica have only what the wanted names depend on,
        states being known. Raises ModelError for another format or a function that the format lacks.
        """
        return write_equations(self, format, lambda: str(self.diagnosis))

    def function(self, given: Sequence[str], find: Sequence[str]) -> ca.Function:
        """A CasADi function from `given` to `find`, by name; the causality follows from the names.

        One argument and one result per name, vectors (k,). Derivatives are `der(x)`, `der(der(x))`.
        Parameters that are not given have their values. With names `pre(x)` among the given it is the function of an
        instant: from values just before it to values after one round of all whens with true conditions. Raises
        StructureError if `given` does not determine `find` or contradicts itself, ModelError for unknown names.
        """
        before = any(map(is_before, names(given)))
        return instant_function(self, given, find) if before else function(self, given, find)

    def array_function(self, given: Sequence[str], find: Sequence[str]) -> ArrayFunction:
        """A function of NumPy arrays from `given` to `find` with a row for each point, arrays (N, k) to arrays (N, m).

        Its answers are those of `function`, exact on the branch of the start or NaN, ten to a hundred times faster;
        `.jacobian` is its Jacobian. Raises the errors of `function`.
        """
        return ArrayFunction(self, names(given), names(find))

    def with_starts(self, starts: Mapping[str, Any]) -> "Dae":
        """The model with other start values, as `simulate(..., starts=)` takes them, for many runs from these."""
        return self.of(with_starts(self, starts))

    def evaluate(self, values: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """All variables and derivatives at a consistent point that holds `values` exactly.

        Quantities without a value are completed from the start values. values: name -> float or array; derivatives are
        `der(x)`, and parameters may be given too. Raises InitializationError if there is no such point.
        """
        return evaluate(self, dict(values or {}))


def translate(
    model: Model | FlatModel,
    *,
    given: Sequence[str] = (),
    find: Sequence[str] = (),
    states: Sequence[str] | None = None,
    units: bool = True,
    events: bool = False,
) -> Dae:
    """Turn a model, flattened or not, into a system of index one, sorted into blocks.

    given: names known as functions of time, in place of the declared inputs (parameters named here stay symbols).
    find: names and derivatives that must be available. states: names preferred as states. units: check the dimensions
    of all equations. events: accept sampled variables, Discretes set by whens and sticking friction; they are known, listed
    after the inputs. Raises ModelError for invalid declarations, StructureError if the
    equations cannot determine the unknowns, InitializationError if no consistent start is found.
    """
    request = Request(names(given), names(find), names(states or ()))
    with timed("translating"):
        flat = model if isinstance(model, FlatModel) else flatten(model)
        if units:
            check_units(flat)
        if not events:
            refuse_events(flat)
        return Dae.of(translate_flat(flat, request))
