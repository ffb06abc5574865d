"""What jumps or bends and is differentiated throws the states of FMUs as those of a simulation, on all interfaces."""

import math
from typing import Any

import pytest

from gantrytau import Fixed, Input, Model, Real, Samples, SolveError, der, if_else
from gantrytau.blocks import Step
from gantrytau_fmu import export_fmu, run_fmu
from tests.families import first_of
from tests.simulation.test_impulses import Cam, ChargedByVoltage, Divider, Drag, Held, Loose

WAYS = [(version, exchange) for version in ("3.0", "2.0") for exchange in (False, True)]


class Stepping(Divider):
    source = Step(start_time=1.0, height=8.0)

    def equations(self) -> Any:
        yield from super().equations()
        yield self.s.v == self.source.y


class Jumping(Held):
    drive: Any
    source = Step(start_time=1.0)

    def equations(self) -> Any:
        yield from super().equations()
        yield self.drive.s == self.source.y


class Switched(Model):
    """Two flywheels of 1 and 3 kg m2 on a gear whose ratio of speeds an input chooses, 1 or 2."""

    u = Input(start=0.0)
    w, v, tau = Real(start=4.0, fixed=True), Real(), Real()

    def equations(self) -> Any:
        ratio = if_else(self.u > 0.5, 2.0, 1.0)
        yield self.v == ratio * self.w
        yield der(self.w) == -ratio * self.tau
        yield 3.0 * der(self.v) == self.tau


@pytest.mark.parametrize(("version", "exchange"), first_of(WAYS, 2))
def test_a_step_of_voltage_divides_by_the_capacities(version, exchange, tmp_path):
    for fixed in ("C", "D"):
        file = tmp_path / f"{fixed}.fmu"
        export_fmu(Stepping(**{fixed: dict(v=Fixed(0.0))}), file, fmi=version, tolerance=1e-9)
        found = run_fmu(file, stop=2.0, step=0.3, model_exchange=exchange, tolerance=1e-9)
        assert found.final("D.v") == pytest.approx(2.0 * math.exp(-1 / 4), rel=1e-7)


@pytest.mark.parametrize(("version", "exchange"), first_of(WAYS, 2))
def test_a_cam_shares_its_momentum_with_what_it_takes_along(version, exchange, tmp_path):
    file = tmp_path / "cam.fmu"
    export_fmu(Cam(), file, fmi=version)
    found = run_fmu(file, stop=2.0, step=0.3, model_exchange=exchange)
    assert (found.final("v"), found.final("w")) == pytest.approx((0.25, 0.25), rel=1e-12)


@pytest.mark.parametrize("exchange", [False, True])
def test_an_input_that_switches_a_constraint_throws_too(exchange, tmp_path):
    file = tmp_path / "gear.fmu"
    export_fmu(Switched(), file)
    inputs = {"u": Samples([0.0, 0.5, 1.0], [0.0, 1.0, 1.0], kind="constant")}
    found = run_fmu(file, stop=1.0, step=0.25, model_exchange=exchange, inputs=inputs)
    # w + 3 ratio v is kept, the ratio being that behind the switch
    assert found.final("w") == pytest.approx((4.0 + 3 * 2 * 4.0) / (1 + 3 * 2**2), rel=1e-9)


REFUSED: list[tuple[type[Model], str]] = [
    (Jumping, "the condition on time turns, and drive.f would be infinite"),
    (Drag, "the jump takes impulses that stand in a law that is not linear in them"),
    (Loose, "what jumps is not determined by the equations behind it"),
]


@pytest.mark.parametrize(("model", "words"), REFUSED)
def test_what_no_impulse_does_is_refused(model, words, tmp_path):
    file = tmp_path / "refused.fmu"
    export_fmu(model(), file)
    with pytest.raises(SolveError, match=words):
        run_fmu(file, stop=2.0, step=0.3, model_exchange=model is Jumping)


def test_charge_is_kept_where_the_capacity_changes_with_the_voltage(tmp_path):
    file = tmp_path / "charged.fmu"
    export_fmu(ChargedByVoltage(), file)
    found = run_fmu(file, stop=2.0, step=0.3)
    v, u = found.final("v"), found.final("u")
    assert (v + v**3, v + u) == pytest.approx((2 * u, 3.0), rel=1e-8)  # 64 steps of fourth order
