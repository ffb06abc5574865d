"""Tables in FMUs: the motions of simulate, events at the kinks, an end with names."""

from typing import Any
from zipfile import ZipFile

import numpy as np
import pytest
from fmpy import simulate_fmu

from gantrytau import Model, Output, Parameter, Real, der, simulate, table, terminate, when
from gantrytau_fmu import export_fmu


class Spring(Model):
    """A mass of 1 kg on a spring whose force is a table."""

    kind: Any = "linear"
    outside: Any = "hold"
    xs = np.linspace(-1.5, 1.5, 7)
    m = Parameter(1.0, unit="kg")
    s = Real(unit="m", start=0.0, fixed=True)
    v = Real(unit="m/s", start=1.0, fixed=True)
    r = Parameter(1.0, unit="m")
    f = Output(unit="N")

    def equations(self):
        ys = -self.xs * (1 + 0.3 * np.sin(3 * self.xs))
        yield der(self.s) == self.v
        yield self.m * der(self.v) == self.f
        yield self.f == table(self.s, self.xs, ys, kind=self.kind, outside=self.outside)


def spring(**members):
    return type("Spring", (Spring,), members)()


@pytest.mark.parametrize("interface", ["CoSimulation", "ModelExchange"])
@pytest.mark.parametrize(("kind", "outside"), [("linear", "hold"), ("spline", "linear")])
def test_an_fmu_moves_as_simulate(tmp_path, kind, outside, interface):
    model = spring(kind=kind, outside=outside, xs=np.linspace(-0.6, 0.6, 12))
    export_fmu(model, tmp_path / "spring.fmu", tolerance=1e-11, find=["s", "v"])
    found = simulate_fmu(
        tmp_path / "spring.fmu",
        stop_time=3.0,
        output_interval=0.1,
        fmi_type=interface,
        relative_tolerance=1e-11,
    )
    motion = simulate(model, stop=3.0, tolerance=1e-12, points=31)
    places = [int(np.argmin(np.abs(found["time"] - t))) for t in motion.time]
    same = np.abs(found["time"][places] - motion.time) < 1e-9
    assert same.sum() >= 31
    error = np.max(np.abs(found["s"][places][same] - motion["s"][same]))
    assert error < (
        1e-9 if interface == "CoSimulation" else 1e-7
    )  # the importer's integrator in Model Exchange


def test_an_fmu_that_leaves_its_table_ends_with_the_name_of_the_argument(tmp_path):
    class Stopping(Spring):
        def equations(self):
            yield from super().equations()
            yield when(self.s < -2 * self.r, terminate("never"))

    short = type("Short", (Stopping,), dict(outside="error", xs=np.linspace(-0.5, 0.5, 7)))()
    export_fmu(short, tmp_path / "short.fmu")
    told = []
    with pytest.raises(Exception, match="fmi3DoStep failed with status 3"):
        simulate_fmu(
            tmp_path / "short.fmu", stop_time=3.0, output_interval=0.1, fmi_type="CoSimulation", debug_logging=True,
            logger=lambda *args: told.append(args[-1].decode() if isinstance(args[-1], bytes) else str(args[-1])),
        )  # fmt: skip
    assert any("s leaves its table, which ends at -0.5 and 0.5" in line for line in told), told


def test_the_code_of_a_table_is_in_proportion_to_its_points(tmp_path):
    sizes = []
    for count in (20, 80):
        path = tmp_path / f"t{count}.fmu"
        export_fmu(spring(xs=np.linspace(-1.5, 1.5, count)), path)
        with ZipFile(path) as archive:
            sizes.append(len(archive.read("sources/model.c")))
    assert sizes[1] < 4.1 * sizes[0]
