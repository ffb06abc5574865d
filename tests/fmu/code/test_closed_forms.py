"""Closed forms that end, as x = sqrt(L^2 - y^2) of a pendulum at the bottom, where the states y and v_y stand still.

Nothing in the rates tells: (-L, 0) is an equilibrium of the equations in y. The root itself is watched.
"""

import numpy as np
import pytest

from gantrytau import Fixed, Model, Parameter, Real, der, if_else, simulate, sin, translate
from gantrytau_fmu.systems.slave import hook_log
from gantrytau_models import GantryTau, Pendulum, prototypes
from tests.fmu.exported import export
from tests.fmu.runtime.raw_calls import OK

VERSIONS = pytest.mark.parametrize("version", [2, 3])


@pytest.fixture(scope="module")
def pendulums(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pendulums")
    return {
        (version, solver): export(Pendulum(), folder / f"{version}{solver}.fmu", version, solver=solver)  # pyright: ignore[reportArgumentType]
        for version in (2, 3)
        for solver in ("dopri5", "rodas4")
    }


@VERSIONS
@pytest.mark.parametrize("solver", ["dopri5", "rodas4"])
@pytest.mark.parametrize("step", [0.001, 0.004, 0.1, 1.0])
def test_a_pendulum_does_not_stand_still_at_the_bottom(pendulums, version, solver, step):
    truth = simulate(Pendulum(), stop=0.6, points=601)
    bottom = float(np.interp(0.0, -truth["x"], truth.time))
    with pendulums[version, solver].new() as run:
        run.begin()
        k, status = 0, OK
        while status == OK and k * step < 1:
            status = run.instance.step(k * step, step)
            k += 1
        assert status != OK
        assert "the equations for x become singular" in run.instance.message
        reached = float(run.instance.message.split("time = ")[1].split(" s")[0])
        # 1e-4 of the length before the bottom at 2.8 m/s, and what is lost of accuracy there
        assert reached == pytest.approx(bottom, abs=2e-4)


@VERSIONS
@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-9])
@pytest.mark.parametrize("interval", [0.001, 0.01])
def test_the_integrator_of_an_importer_does_not_mirror_it(pendulums, version, tolerance, interval):
    from fmpy import simulate_fmu

    lines = []
    with pytest.raises(Exception, match=r"failed with status 3|CVode error"):
        simulate_fmu(
            str(pendulums[version, "dopri5"].path),
            fmi_type="ModelExchange",
            stop_time=1.0,
            output_interval=interval,
            relative_tolerance=tolerance,
            logger=lambda *words: lines.append(words[-1]),
        )
    hook_log()  # FMPy's proxy keeps calling the last logger, which is gone
    assert any(b"singular" in line for line in lines), lines


def test_another_choice_of_states_swings_through(tmp_path):
    truth = simulate(Pendulum(), stop=2.0, points=501, tolerance=1e-10)
    with export(Pendulum(), tmp_path / "x.fmu", states=["x", "v_x"]).new() as run:
        run.begin()
        for k in range(500):
            run.time = k * 0.004
            run.step(0.004)
            assert run[["x", "y"]] == pytest.approx([truth["x"][k + 1], truth["y"][k + 1]], abs=1e-5)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
def test_a_robot_stops_where_a_cart_cannot_follow_also_with_rough_steps(tmp_path, tolerance):
    """Forces that carry the tool to the end of its coordinates at 0.635 s."""
    forces = {f"carts[{k}].f": f for k, f in enumerate((499.0, 152.0, -265.0))}
    dae = translate(GantryTau(prototypes.L1), events=True)
    with export(dae, tmp_path / "robot.fmu", solver="rodas4", tolerance=tolerance).new() as run:
        run.begin(**forces)
        k, status = 0, OK
        while status == OK and k < 250:
            status = run.instance.step(k * 0.004, 0.004)
            k += 1
        assert status != OK
        assert run.instance.message.startswith("GantryTau: the equations for carts[0].s become singular")
        assert k * 0.004 == pytest.approx(0.636, abs=1e-9)


@pytest.mark.parametrize("angle", [0.0, np.pi, np.pi / 2, 1e-12])
def test_a_four_bar_starts_with_its_crank_in_line_with_an_axis(exported, angle):
    """No pivot is a sine or cosine of the crank, whatever it was at the start of the export."""
    fmu = exported("four-bar")
    truth = fmu.dae.evaluate({"crank.phi": angle, "crank.w": 0.0, "torque": 0.0})
    with fmu.new() as run:
        run.begin(**{"crank.phi": angle})
        assert run["der(crank.w)"] == pytest.approx(float(np.ravel(truth["der(crank.w)"])[0]), rel=1e-8)


class Divided(Model):
    """y = sin(phi) / phi, as an equation of y whose coefficient is a state."""

    phi = Real(start=1.0, fixed=True, description="state")
    y = Real(description="sin(phi) / phi")

    def equations(self):
        yield self.phi * self.y == sin(self.phi)
        yield der(self.phi) == -self.y


def test_a_start_at_which_the_equations_divide_by_zero_is_refused_and_a_millionth_beside_it_is_right(
    tmp_path,
):
    fmu = export(Divided(), tmp_path / "divided.fmu")
    with fmu.new() as run:
        run.enter()
        run["phi"] = 0.0
        assert run.instance("ExitInitializationMode") != OK
        assert "divide by zero because of phi" in run.instance.message
    with fmu.new() as run:
        run.begin(phi=1e-6)
        assert run["der(phi)"] == pytest.approx(-1.0, rel=1e-8)


class Guarded(Model):
    """A division that the model guards itself, and one by a parameter that changes by decades."""

    m = Parameter(2e9, description="divides")
    v = Real(start=1.0, fixed=True, description="state")
    y = Real(description="sin(v) / v")

    def equations(self):
        yield self.y == if_else(self.v**2 > 1e-12, sin(self.v) / self.v, 1.0)
        yield der(self.v) == 1.0 / self.m - 0.1 * self.y


@pytest.mark.parametrize("changes", [{"v": 0.0}, {"m": 1.0}, {"v": 0.0, "m": 1e-3}])
def test_divisors_that_are_small_and_do_no_harm_raise_no_alarm(tmp_path, changes):
    modified = {name: Fixed(value) if name == "v" else value for name, value in changes.items()}
    truth = simulate(Guarded(**modified), stop=0.1, points=2, tolerance=1e-10)
    with export(Guarded(), tmp_path / "guarded.fmu").new() as run:
        run.begin(**changes)
        run.step(0.1)
        assert run["v"] == pytest.approx(truth["v"][-1], rel=1e-5)
