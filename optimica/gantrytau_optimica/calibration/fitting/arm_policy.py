"""How the arms of a robot are fitted: priors, a loss and constraints of all arms, handed to each."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from gantrytau import ModelError
from gantrytau.errors import did_you_mean
from gantrytau_optimica.calibration.data.measurements import Measurements
from gantrytau_optimica.calibration.fitting.arm_fit import NOISE, ArmFit, fit_arm, huber
from gantrytau_optimica.calibration.rods.arms import Arm


@dataclass(frozen=True)
class Policy:
    """method, loss, constraints: as of `calibrate`; prior: deviations by full names."""

    method: str = "gauss-newton"
    prior: Mapping[str, float] = field(default_factory=dict)
    loss: str = "linear"
    constraints: Mapping[str, Any] | None = None


def fit_arms(arms: Sequence[Arm], data: Measurements, policy: Policy) -> tuple[ArmFit, ...]:
    """All arms one by one."""
    return tuple(_fit(arm, data, policy) for arm in arms)


def _fit(arm: Arm, data: Measurements, policy: Policy) -> ArmFit:
    names = {*arm.names, *(n.rpartition("[")[0] for n in arm.names)}
    own = {name: deviation for name, deviation in policy.prior.items() if name in names}
    found = fit_arm(arm, data.q, data.r, data.R, prior=own, loss=policy.loss)
    if policy.method != "ipopt":
        return found
    from gantrytau_optimica.calibration.fitting.arm_ipopt import fit_arm_with_ipopt

    weights = huber(found.residuals, NOISE) if policy.loss == "robust" else None
    wanted = {key: value for key, value in (policy.constraints or {}).items() if _belongs(arm, key)}
    return fit_arm_with_ipopt(arm, data.q, data.r, data.R, prior=own, weights=weights, constraints=wanted)


def check_constraints(arms: Sequence[Arm], constraints: Any) -> None:
    """ModelError for constraints between arms, which are fitted one by one, and on what is not identified."""
    if constraints is None:
        return
    from gantrytau_optimica.calibration.fitting.constraints import read_constraints

    read_constraints(constraints, [name for arm in arms for name in arm.names])
    for key, value in constraints.items():
        if isinstance(value, str) and not any(_belongs(arm, key) and _belongs(arm, value) for arm in arms):
            raise ModelError(
                f"calibrate: constraints: '{key}': '{value}' is between two arms, expected numbers of one arm of a robot "
                "with turntables, whose arms are fitted one by one",
                argument="constraints",
            )


def _belongs(arm: Arm, name: str) -> bool:
    name = name.strip("|")
    return any(name in (n, n.rpartition("[")[0]) for n in arm.names)


def full_prior(arms: Sequence[Arm], prior: Mapping[str, Any] | None) -> dict[str, float]:
    """Deviations by full names; a key may be the last part of names of all arms. ModelError for unknown names."""
    elements = [name for arm in arms for name in arm.names]
    vectors = list(dict.fromkeys(n.rpartition("[")[0] if n.endswith("]") else n for n in elements))
    found: dict[str, float] = {}
    for key, deviation in (prior or {}).items():
        matches = [n for n in (*vectors, *elements) if n == key or n.rpartition(".")[2] == key]
        if not matches:
            raise ModelError(
                f"calibrate: prior for '{key}', which is not identified{did_you_mean(key, vectors)}",
                argument="prior",
            )
        if not isinstance(deviation, (int, float)) or not deviation > 0:
            raise ModelError(
                f"calibrate: found the deviation {deviation!r} for '{key}' in prior, expected one number above 0, about the "
                "nominal value",
                argument="prior",
            )
        found |= dict.fromkeys(matches, float(deviation))
    return found
