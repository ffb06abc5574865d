"""Controller and led tool as FMUs of their own: what the order of steps of a master does to a loop of 4 ms."""

from dataclasses import replace

import numpy as np
import pytest

from gantrytau import Samples, simulate, translate
from gantrytau_fmu import Master, cosimulate, export_fmu
from gantrytau_models.leadthrough import ContactLoop, LeadThrough, LedTool, SurfaceTracking, surfaces

PERIOD = 0.004
QUIET = dict(tremor=0.0, speed=0.0)
WIRES = [
    ("tool.f_h", "control.f_h"),
    ("tool.f_t", "control.f_t"),
    ("tool.v_tool", "control.v_tool"),
    ("control.v", "tool.v_ref"),
]


@pytest.fixture(scope="module")
def fmus(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fmus")
    tool = LedTool(surfaces.METAL)
    return dict(
        control=export_fmu(LeadThrough(), folder / "control.fmu"), tool=export_fmu(tool, folder / "tool.fmu")
    )


def test_gauss_seidel_moves_as_the_whole_model(fmus):
    random = np.random.default_rng(1)
    # between the instants, so that nobody asks on which side of a jump a sample is taken
    jumps = (np.arange(751) - 0.25) * PERIOD
    sizes = {"hand.white_force": (), "hand.white": (), "sensor.white_f": (3,)}
    one = {
        name: Samples(jumps, random.standard_normal((751, *shape)), kind="constant")
        for name, shape in sizes.items()
    }
    whole = simulate(
        translate(SurfaceTracking(surfaces.METAL), events=True),
        stop=3.0,
        points=751,
        inputs=one,
        tolerance=1e-12,
    )
    parts = cosimulate(
        fmus,
        WIRES,
        stop=3.0,
        step=PERIOD,
        inputs={f"tool.{name}": signal for name, signal in one.items()},
        master=Master(tolerance=1e-12),
    )
    assert whole["f_n"].max() > 2
    rows = np.searchsorted(whole.time, parts.time - 1e-9)
    assert np.allclose(parts["tool.v_tool"], whole["v_tool"][rows], rtol=0, atol=1e-12)
    depth = (parts["tool.f_n"] - whole["f_n"][rows]) / surfaces.METAL.stiffness
    assert np.abs(depth).max() < 1e-12


@pytest.mark.parametrize(("share", "hops"), [(0.9, False), (1.05, True)])
def test_jacobi_is_a_sample_late_and_bears_a_third_of_the_gain(fmus, share, hops):
    late = ContactLoop(1.0, delay=PERIOD)
    assert np.isclose(late.critical_gain / ContactLoop(1.0).critical_gain, 0.313, atol=0.001)
    start = {"tool.face.stiffness": share * late.critical_gain / 0.03, "tool.face.tilt": 0.0}
    start |= {f"tool.hand.{name}": value for name, value in QUIET.items()}
    run = cosimulate(fmus, WIRES, stop=12.0, step=PERIOD, start=start, master=Master(order="jacobi"))
    force = run["tool.f_n"][run.time > 6.0]
    if not hops:
        assert np.ptp(force) < 0.05
        return
    assert np.ptp(force) > 1
    spectrum = np.abs(np.fft.rfft((force - force.mean()) * np.hanning(force.size)))
    assert abs(np.fft.rfftfreq(force.size, PERIOD)[np.argmax(spectrum)] - 30.7) < 1.0


def test_records_of_other_stiffness_are_replaced():
    soft = replace(surfaces.METAL, stiffness=1e3)
    assert SurfaceTracking(soft).modifications["face"]["stiffness"] == 1e3
