"""From a model without physics to masses, damping and stiffness."""

from dataclasses import dataclass

from numpy.typing import ArrayLike

from gantrytau.answers.linear_systems.linear_system import LinearSystem
from gantrytau_optimica.fitting.finding import Finding
from gantrytau_optimica.identification.physical.form_findings import form_findings
from gantrytau_optimica.identification.physical.known_motion import KnownMotion, KnownResponse
from gantrytau_optimica.identification.physical.mechanical_form import MechanicalForm
from gantrytau_optimica.identification.physical.output_coordinates import continuous_of, direct_form
from gantrytau_optimica.identification.physical.structured_fit import Known, explained, structured_form


@dataclass(frozen=True, eq=False, repr=False)
class PhysicalForm(MechanicalForm):
    """M, D and K of a black box, (6.14), by a structured fit or directly.

    direct: by output coordinates, with nothing enforced, always made; fit: % of the response of the black box, or of what
    was measured, that M, D and K explain. `definite` is that of both: a structured fit has a definite M and K whatever the
    data are, and would hide it.
    """

    direct: MechanicalForm
    fit: float
    findings: tuple[Finding, ...]

    @property
    def definite(self) -> bool:
        """Whether M, D and K are positive definite, and those of the direct route as well."""
        return not (self.indefinite or self.direct.indefinite)

    def __repr__(self) -> str:
        return "\n".join([super().__repr__()[:-1], *(f"  {finding}" for finding in self.findings)]) + ">"


def physical_form(
    system: LinearSystem,
    *,
    structured: bool = True,
    measured: tuple[ArrayLike, ArrayLike] | None = None,
) -> PhysicalForm:
    """Mass, damping and stiffness of a model that was identified without physics: M z'' + D z' + K z = f.

    system: of order 2 n from n forces to the n positions along them, sampled with held inputs (then by the logarithm of
    its matrices) or continuous. Directly, output coordinates give M = (C A B)^-1, neither symmetric nor definite.
    structured: from there on fit M = S S', K = S S' and a symmetric D to the response of the system. measured: fit (u, y)
    instead, forces and positions (N, n) each at the period of the system: only these show modes that the system lacks.
    Both routes are compared: what is indefinite, not symmetric or not explained stands in `.findings`.
    Raises ModelError for another order and for poles that no continuous system has, IdentificationError for unstable
    systems and outputs that are no positions. Dressler (2012), (6.14) and (6.15).
    """
    name = f"physical_form of {system.title}"
    continuous = continuous_of(system)
    direct = direct_form(name, continuous)
    known: Known = KnownResponse.of(continuous)
    if measured is not None:
        known = KnownMotion.of(measured, system, known.frequency)
    form = structured_form(known, direct) if structured else direct
    fit = explained(known, form)
    findings = form_findings(form, direct, known.missed(form), system, continuous)
    return PhysicalForm(form.M, form.D, form.K, direct, fit, findings)
