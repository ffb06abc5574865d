"""What `identify` found: masses and friction by name, how sure they are, and what is left of the forces."""

import dataclasses
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau import Model, ModelError
from gantrytau.describing.pages import page, table
from gantrytau.describing.record import Record
from gantrytau_optimica.calibration.links.nominal_rods import with_numbers
from gantrytau_optimica.fitting.diagnostics import Diagnostics
from gantrytau_optimica.fitting.finding import Finding
from gantrytau_optimica.identification.rigid.robot_dynamics import expanded


@dataclass(frozen=True, eq=False)
class Identification(Record):
    """Identified parameters of a robot of rigid bodies.

    parameters: masses in kg, `coulomb[i]` in N, `viscous[i]` in kg/s, by public name; residuals: what is left of the
    filtered forces in the rows that count, (N, n) in N, NaN elsewhere; squares: their sums for each joint, as of all
    rows of the logs, (n,) in N2; condition: of the normed columns; weak: parameters that the motion hardly tells from
    others, or that are less than twice their deviation; active: those at a limit, where deviations are zero; those of
    bodies are without the condition that they have a density; base: what is determined in place of parameters that no
    motion of this kind tells apart; nonlinear: those in which forces are not linear; model_values:
    what was found and what was fixed by names of the model, as `--set` has them;
    stribeck_speed: m/s, of friction "stribeck", deviations are those at it; held_out: rms of what a fit of the first half
    leaves of the second, N; diagnostics: what is left of the forces, joint by joint.
    """

    robot_name: str
    parameters: Mapping[str, float]
    fixed: Mapping[str, Any]
    matrix: np.ndarray = field(repr=False)
    residuals: np.ndarray = field(repr=False)
    squares: np.ndarray
    condition: float
    weak: tuple[str, ...]
    active: tuple[str, ...]
    base: tuple[str, ...]
    nonlinear: tuple[str, ...]
    stribeck_speed: float | None
    model_values: Mapping[str, float]
    held_out: float
    findings: tuple[Finding, ...]
    diagnostics: Diagnostics = field(repr=False)
    nominal: Model | None = field(repr=False)

    def covariance(self, names: Iterable[str] | str) -> np.ndarray:
        """Covariance (k, k) of parameters in the order of names; zero for those at a limit, NaN where not determined.

        A family, such as "link_masses", stands for all of it. ModelError for names that were not identified.
        """
        all_names = list(self.parameters)
        rows = [all_names.index(n) for n in expanded(names, all_names)]
        return self.matrix[np.ix_(rows, rows)]

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviations by name, in the units of the parameters."""
        return dict(zip(self.parameters, np.sqrt(np.diag(self.matrix)).tolist(), strict=True))

    @property
    def robot(self) -> Model:
        """The robot with the identified parameters. ModelError where identify was given a translated one."""
        if self.nominal is None:
            raise ModelError(
                f"robot: {self.robot_name} was identified from what translate made of it, expected the model; give that to "
                "identify, or use .model_values"
            )
        return with_numbers(self.nominal, {n.replace(",", "]["): x for n, x in self.model_values.items()})

    def prototype(self, record: Any) -> Any:
        """A record such as `prototypes.L1` with the identified numbers; what was not identified stays as it is."""
        found: dict[str, Any] = {}
        for name, value in self.parameters.items():
            parted = re.fullmatch(r"(\w+)(?:\[(\d+)\])?", name)
            if parted and hasattr(record, parted[1]):
                if parted[2] is None:
                    found[parted[1]] = value
                else:
                    values = found.setdefault(parted[1], list(getattr(record, parted[1])))
                    values[int(parted[2])] = value
        return dataclasses.replace(record, **found)

    def report(self, path: str | Path) -> Path:
        """Write the parameters, findings and sums of squares as one HTML page; returns its path."""
        deviations = self.deviations
        rows = [
            (n, f"{v:.6g}", f"{deviations[n]:.3g}", ", ".join(self._remarks(n)))
            for n, v in self.parameters.items()
        ]
        sums = [(f"{i}", f"{s:.4g}") for i, s in enumerate(self.squares)]
        parts = [
            f"<h1>{escape(self.robot_name)}</h1>",
            table(("parameter", "value", "deviation", "remark"), rows, "numbers"),
            f"<p>Condition of the normed columns: {self.condition:.4g}. Held out: {self.held_out:.4g} N rms.</p>",
            table(("joint", "sum of squares, N2"), sums, "numbers"),
            *(f"<p>{escape(str(f))}</p>" for f in self.findings),
        ]
        path = Path(path)
        path.write_text(page(f"Identification of {self.robot_name}", parts), encoding="utf-8")
        return path

    def _remarks(self, name: str) -> list[str]:
        sets = (("weak", self.weak), ("at its limit", self.active), ("not linear", self.nonlinear))
        return [words for words, names in sets if name in names]

    def __str__(self) -> str:
        deviations = self.deviations
        lines = [f"{self.robot_name}: sums of squares {', '.join(f'{s:.4g}' for s in self.squares)} N2"]
        lines += [
            f"  {n:20s} {v:12.6g} +- {deviations[n]:<10.3g}{', '.join(self._remarks(n))}"
            for n, v in self.parameters.items()
        ]
        return "\n".join([*lines, *(f"  {f}" for f in self.findings)])
