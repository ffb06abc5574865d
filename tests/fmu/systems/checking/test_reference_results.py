"""FMUs that carry reference results: rerun, compared, and told of when they or the FMU were changed.

Three tests take seconds: each run begins two processes, a trial of the binary and the rerun.
"""

import zipfile

import numpy as np
import pytest

from gantrytau import Input, Model, ModelError, Output, Parameter, Real, der, sampled, simulate
from gantrytau.results.result import Result
from gantrytau_fmu import Build, check_fmu, export_fmu, read_fmu
from gantrytau_fmu.building.archive import write_archive
from gantrytau_fmu.describing.reference_files import DRAFT, FOLDER, MANIFEST

CSV = f"{FOLDER}reference.csv"


class Tank(Model):
    """A tank that leaks, and a gauge that reads it every 50 ms."""

    k = Parameter(2.0, unit="1/s", description="leak")
    q = Input(unit="m/s", description="what flows in", start=0.0)
    level = Output(unit="m", description="level")
    above = Output(unit="m", description="level above the last reading")
    h = Real(unit="m", start=1.0, fixed=True)
    read = Real(unit="m", start=1.0)

    def equations(self):
        yield sampled(self.read, self.h, period=0.05)
        yield self.above == self.h - self.read
        yield der(self.h) == self.q - self.k * self.h
        yield self.level == self.h


@pytest.fixture(scope="module")
def filling():
    return simulate(Tank(), stop=1.0, inputs={"q": lambda t: 0.5 * t})


@pytest.fixture(scope="module")
def tank(filling, tmp_path_factory):
    return export_fmu(Tank(), tmp_path_factory.mktemp("tank") / "tank.fmu", reference=filling)


def members(path):
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def told(path, **options):
    return [str(finding).removeprefix(f"{path}: ") for finding in check_fmu(path, **options)]


def test_a_reference_is_run_again_and_others_take_the_fmu_as_a_plain_one(tank, filling):
    from fmpy import simulate_fmu
    from fmpy.validation import validate_fmu

    within = "2 signals over 1 s within 0.001 of the range"
    assert told(tank, run=True) == [f"note: {CSV}: run again, {within}"]
    assert told(tank) == []
    assert validate_fmu(tank) == []
    # x' = -2 x without inflow
    assert simulate_fmu(tank, stop_time=1.0)["level"][-1] == pytest.approx(np.exp(-2.0), rel=1e-5)
    found = members(tank)
    assert b"'h'" in found[f"{DRAFT}equations.mo"]
    assert found[CSV].startswith(b'"time","q","level","above"\n0.0,0.0,1.0,0.0\n')
    assert read_fmu(tank).experiment.stop == 1.0


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            b'"level"',
            b'"lvel"',
            f"error: {CSV}: found a column 'lvel', expected variables of the FMU; did you",
        ),
        (b'"level"', b'"k"', f"error: {CSV}: found no column 'level', expected all inputs and outputs"),
        (b'"level"', b'"q"', f"error: {CSV}: found two columns 'q', expected different names"),
        (
            b"\n0.0,0.0,1.0,0.0",
            b"\n0.0,0.0,nan,0.0",
            f"error: {CSV}: line 2, column level: found 'nan', expected a",
        ),
        (
            b"\n0.0,0.0,1.0,0.0",
            b"\n0.0,0.0,1.0",
            f"error: {CSV}: line 2 has 3 cells, expected 4 as the header",
        ),
        (
            b"\n0.0,0.0,1.0,0.0",
            b"\n0.1,0.0,1.0,0.0",
            f"error: {CSV}: line 3: the time falls from 0.1 to 0.002 s",
        ),
        (
            b"\n0.0,0.0,1.0,0.0",
            b"\n0.001,0.0,1.0,0.0",
            f"error: {CSV}: found results from 0.001 to 1 s, expected some",
        ),
        (b'"time"', b'"h"', f"error: {CSV}: found no column 'time', expected times in s"),
    ],
)
def test_a_damaged_reference_is_told_with_its_place(tank, tmp_path, old, new, message):
    found = members(tank)
    assert found[CSV].count(old) == 1
    lines = told(write_archive(tmp_path / "tank.fmu", found | {CSV: found[CSV].replace(old, new)}))
    assert f"error: {CSV}: found a file with SHA-256 " in lines[0]
    assert [line for line in lines if line.startswith(message)]


def test_files_that_are_gone_or_of_other_equations_are_told(tank, tmp_path):
    path, found = tmp_path / "tank.fmu", members(tank)
    left = {name: content for name, content in found.items() if name != CSV}
    lines = told(write_archive(path, left))
    assert lines == [
        f"warning: {MANIFEST} lists '{CSV}' as result, found no such file; ask its author for it again"
    ]
    (line,) = told(
        write_archive(path, {name: content for name, content in found.items() if name != MANIFEST})
    )
    assert line.startswith(f"warning: found files in {FOLDER} but no {MANIFEST}, which lists them")
    token = read_fmu(tank).token.encode()
    lines = told(write_archive(path, found | {MANIFEST: found[MANIFEST].replace(token, b"{other}")}))
    assert (
        f"{CSV}: found results or equations of an FMU with the token {{other}}, expected {token.decode()}"
        in lines[0]
    )
    lines = told(write_archive(path, found | {MANIFEST: found[MANIFEST].replace(b"fmiReferences", b"other")}))
    assert lines[0].startswith(f"error: {MANIFEST} begins with 'other', expected fmiReferences")
    (line,) = told(write_archive(path, found | {MANIFEST: b"<fmiReferences>"}))
    assert line.startswith(f"error: '{MANIFEST}'")


def test_a_motion_of_one_per_cent_more_leaves_the_reference(tmp_path):
    """h = exp(-2 t) against exp(-2.02 t); what is above the last reading has a range of 0.095 m."""
    other = simulate(Tank(), stop=1.0, parameters={"k": 2.02})
    with pytest.raises(ModelError, match=r"k = 2\.02, expected that of the model, 2; run it anew"):
        export_fmu(Tank(), tmp_path / "tank.fmu", reference=other)
    unnamed = Result(other.time, {name: other[name] for name in other.names if name != "k"})
    path = export_fmu(Tank(), tmp_path / "tank.fmu", reference=unnamed)
    (line,) = told(path, run=True)
    # 0.02 t exp(-2 t)
    assert line.startswith(f"error: {CSV}: above leaves its reference at t = 0.006 s by 0.000119 m (later by")
    assert "2 of 2 signals leave), expected -0.0120" in line


def test_customary_results_beside_a_foreign_fmu_are_run_again(tank, filling, tmp_path):
    path = tmp_path / "theirs.fmu"
    write_archive(path, {n: x for n, x in members(tank).items() if not n.startswith("extra/")})
    for end, name in (("ref", "level"), ("in", "q")):
        rows = zip(filling.time[::5], filling[name][::5], strict=True)
        lines = [f"time,{name}", *(f"{t!r},{x!r}" for t, x in np.array(list(rows)).tolist())]
        path.with_name(f"theirs_{end}.csv").write_text("\n".join(lines))
    within = "1 signal over 1 s within 0.002 of the range"
    assert told(path, run=True) == [f"note: theirs_ref.csv: run again, {within}"]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: simulate(Tank(), stop=1.0, outputs=["h"]), r"reference: found no 'q' in the result"),
        (lambda: simulate(Tank(), start=1.0, stop=2.0), r"found results from 1 to 2 s, expected some from 0"),
        (lambda: Result([0, 1], {"q": 0.0, "level": [1.0, np.nan], "above": 0.0}), r"level is nan at t = 1"),
        (lambda: -1.0, r"export_fmu: .*reference.*-1"),
        (lambda: "much", r"reference: found 'much', expected a number"),
    ],
)
def test_a_result_that_does_not_fit_is_refused(tmp_path, make, message):
    with pytest.raises(ModelError, match=message) as refusal:
        export_fmu(Tank(), tmp_path / "tank.fmu", reference=make(), build=Build(platforms=()))
    assert refusal.value.argument == "reference"
    assert not list(tmp_path.iterdir())
