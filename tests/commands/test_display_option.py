"""Units on the command line: values that bring theirs, `--display`, and CSV files in other units."""

import csv

import numpy as np
import pytest

from gantrytau.commands.arguments.display_option import displayed
from gantrytau.commands.printing.reporting import CommandError

TURN = '''\
"""A shaft."""
from gantrytau import Input, Model, Parameter, Real, der

class Shaft(Model):
    """A shaft that turns."""

    J = Parameter(1.0, unit="kg.m2", description="moment of inertia")
    r = Parameter([0.0, 0.0], unit="m", display="mm", description="place")
    phi = Real(unit="rad", display="deg", start="90 deg", fixed=True, description="angle")
    w = Real(unit="rad/s", start=0.0, fixed=True, description="angular velocity")
    tau = Input(unit="N.m", start=0.0, description="torque")

    def equations(self):
        yield self.w == der(self.phi)
        yield self.J * der(self.w) == self.tau
'''


@pytest.fixture
def shaft(tmp_path):
    path = tmp_path / "shaft.py"
    path.write_text(TURN)
    return f"{path}:Shaft"


@pytest.mark.parametrize(
    ("texts", "found"),
    [
        (None, None),
        (["deg"], "deg"),
        (["SI"], "SI"),
        (["phi=deg,length=mm", "der(phi)=deg/s"], {"phi": "deg", "length": "mm", "der(phi)": "deg/s"}),
        (["R[0,1]=%"], {"R[0,1]": "%"}),
    ],
)
def test_what_is_asked_for(texts, found):
    assert displayed(texts) == found


@pytest.mark.parametrize(
    ("texts", "words"),
    [
        (["deg,mm"], "--display deg: expected NAME=UNIT where there are several, as --display phi=deg,length=mm"),
        (["phi="], "--display phi=: expected NAME=UNIT"),
        (["degg"], "--display degg: unit 'degg': there is no unit 'degg'; did you mean 'deg'?"),
        (["phi=SI"], "--display phi=SI: unit 'SI': there is no unit 'SI'"),
    ],
)  # fmt: skip
def test_what_cannot_be_asked_for(texts, words):
    with pytest.raises(CommandError) as caught:
        displayed(texts)
    assert words in str(caught.value)


def run_of(answer, shaft, *more):
    return answer("simulate", shaft, "--stop", "1", "--points", "3", *more)


def test_values_on_the_command_line_bring_their_units(answer, shaft):
    more = (
        "--set",
        "J=20000 kg.cm2",
        "--set",
        "phi.start=45 deg",
        "--set",
        "r=[1, 2] mm",
        "--input",
        "tau=4000 N.mm",
    )
    final = run_of(answer, shaft, *more)["final"]
    assert (final["J"], final["r[1]"], final["tau"]) == (2.0, 0.002, 4.0)
    assert final["phi"] == pytest.approx(np.pi / 4 + 1.0, rel=1e-7)  # phi + tau / J t2 / 2


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--set", "J=20 deg"), "J: value: found '20 deg', an angle, expected a moment of inertia in kg.m2"),
        (("--set", "phi.start=20 mm"), "phi: start: found '20 mm', a length, expected an angle in rad"),
        (("--input", "tau=5 N"), "input tau: found '5 N', a force, expected a torque or an energy in N.m"),
        (("--display", "phi=mm"), "--display: phi: found 'mm', a length, expected an angle in rad"),
        (("--display", "phy=deg"), "did you mean 'phi'?"),
        (("--display", "bar", "--plot", "phi", "--to", "x.png"), "found 'bar', a pressure, expected a unit of"),
    ],
)  # fmt: skip
def test_values_and_units_of_another_kind_are_refused(fails, shaft, more, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    told = fails(2 if "--display" in more else 1, "simulate", shaft, "--stop", "1", *more)
    assert words in " ".join(told.split())
    assert not (tmp_path / "x.png").exists()


def test_a_file_in_degrees_drives_and_begins_as_one_in_radians(answer, fails, shaft, tmp_path):
    file = tmp_path / "torque.csv"
    file.write_text("time [ms],tau [N.mm],phi [deg]\n0,0,0\n1000,2000,90\n")
    final = run_of(answer, shaft, "--input", f"tau={file}")["final"]
    assert final["tau"] == 2.0
    assert final["w"] == pytest.approx(1.0, rel=1e-7)
    told = fails(1, "simulate", shaft, "--stop", "1", "--input", f"tau={file}:phi")
    assert "an angle, expected a torque" in " ".join(told.split())
    file.write_text("time,tau [foo]\n0,0\n1,2\n")
    assert "there is no unit 'foo'" in fails(2, "simulate", shaft, "--stop", "1", "--input", f"tau={file}")


def test_results_are_printed_drawn_and_saved_in_units(run, shaft, tmp_path):
    file, picture = tmp_path / "x.csv", tmp_path / "x.png"
    command = ["simulate", shaft, "--stop", "1", "--points", "3"]
    shown = run(*command, "--output", file, "--display", "declared", "--plot", "phi", "--to", picture)
    assert [word for word in shown.stdout.split() if word in ("deg", "rad", "rad/s")] == ["deg", "rad/s"]
    assert "90" in shown.stdout
    assert picture.stat().st_size > 0
    with file.open(newline="") as opened:
        header, *rows = csv.reader(opened)
    assert {"phi [deg]", "r[0] [mm]", "der(phi) [deg/s]", "w [rad/s]"} <= set(header)
    assert float(rows[0][header.index("phi [deg]")]) == 90.0
    assert run(*command, "--output", file, "--display", "w=rpm,time=ms").exit_code == 0
    with file.open(newline="") as opened:
        header = next(csv.reader(opened))
    assert {"time [ms]", "phi [rad]", "w [rpm]"} <= set(header)


def test_files_of_parameters_and_studies_bring_their_units(answer, fails, shaft, tmp_path):
    values = tmp_path / "values.toml"
    values.write_text('J = "20000 kg.cm2"\nr = ["1 mm", "2 mm"]\n')
    final = run_of(answer, shaft, "--set", str(values))["final"]
    assert (final["J"], final["r[1]"]) == (2.0, 0.002)
    values.write_text('J = "20000"\n')
    assert "found '20000' in quotes and without a unit" in " ".join(
        fails(2, "simulate", shaft, "--stop", "1", "--set", str(values)).split()
    )
    study = tmp_path / "study.toml"
    study.write_text(
        f'model = "{shaft}"\nstop = 1.0\noutputs = ["phi"]\n[over]\nJ = ["1 kg.m2", "20000 kg.cm2"]\n'
        'phi = { from = "10 deg", to = "30 deg", number = 3 }\n[set]\nr = "[1, 2] mm"\n[inputs]\ntau = "1 N.m"\n'
    )
    cases = answer("study", str(study))["cases"]
    assert [case["chosen"]["J"] for case in cases] == [1.0, 1.0, 1.0, 2.0, 2.0, 2.0]
    assert [case["chosen"]["phi"] for case in cases[:3]] == pytest.approx(np.radians([10, 20, 30]), rel=1e-15)
    study.write_text(
        f'model = "{shaft}"\nstop = 1.0\n[over]\nphi = {{ from = "10 deg", to = "1 rad", number = 3 }}\n'
    )
    assert "expected one unit; write both in deg" in " ".join(fails(2, "study", str(study)).split())
