"""Units in which results are shown: figures, tables and CSV files; the numbers of a result stay in SI."""

import csv
from typing import Any

import matplotlib
import numpy as np
import pytest

from gantrytau import ModelError, Result, si
from gantrytau.border.columns import Columns

matplotlib.use("Agg")

TIME = np.linspace(0.0, 1.0, 11)


@pytest.fixture
def run():
    phi = np.linspace(0.0, 2 * np.pi, 11)
    values = {
        "phi": phi,
        "psi": 2 * phi,
        "r[0]": 0.7 * TIME,
        "r[1]": TIME,
        "m": 2.0,
        "w": phi,
        "T": 300 + TIME,
    }
    values |= {"p": 0.5 * TIME, "bare": TIME, "f": 10 * TIME}
    units = {"phi": "rad", "psi": "rad", "r": "m", "m": "kg", "w": "rad/s", "T": "K", "p": "1", "f": "N"}
    declared = {"phi": "deg", "r": "mm", "T": "degC"}
    return Result(TIME, values, units=units, displays=declared, title="run", aliases={"minus": "-phi"})  # fmt: skip


def drawn(figure) -> dict[str, tuple[str, np.ndarray]]:
    """Label of each axis and values of its lines, by the names of these."""
    return {
        line.get_label(): (axis.get_ylabel(), np.asarray(line.get_ydata(), float))
        for axis in figure.axes
        for line in axis.lines
    }


def test_figures_show_the_declared_units_and_the_result_stays_in_si(run):
    found = drawn(run.plot("phi", "psi", "r", "T"))
    assert found["phi"][0] == "phi [deg]"
    assert found["phi"][1] == pytest.approx(np.degrees(run["phi"]), rel=1e-15)
    assert found["phi"][1][-1] == 360.0
    assert found["psi"][0] == "psi [rad]"
    assert found["r[0]"] == ("[mm]", pytest.approx(700 * TIME, rel=1e-15))
    assert found["T"][1] == pytest.approx(26.85 + TIME, abs=1e-12)
    assert run["phi"][-1] == 2 * np.pi
    assert run.unit("phi") == "rad"
    assert run.display("phi") == run.display("minus") == "deg"
    assert run.display("r[1]") == "mm"
    assert run.display("psi") == ""


@pytest.mark.parametrize(
    ("display", "labels"),
    [
        ("SI", {"phi": "rad", "psi": "rad", "r[0]": "m", "w": "rad/s"}),
        ("declared", {"phi": "deg", "psi": "rad", "r[0]": "mm", "w": "rad/s"}),
        ("rev", {"phi": "rev", "psi": "rev", "r[0]": "mm", "w": "rad/s"}),
        ({"rad": "mrad", "rad/s": "rpm"}, {"phi": "mrad", "psi": "mrad", "r[0]": "mm", "w": "rpm"}),
        ({"rad": "mrad", "phi": "rev"}, {"phi": "rev", "psi": "mrad"}),
        ({"m": "cm"}, {"r[0]": "cm", "r[1]": "cm"}),  # m is a mass here, and not meant
        ({"m": "g"}, {"m": "g", "r[0]": "mm"}),
        ({"r": "cm", "r[1]": "um", "m": "km"}, {"r[0]": "cm", "r[1]": "um"}),
        ({"phi": "rad", "r": "m"}, {"phi": "rad", "r[0]": "m"}),
        ({"p": "%"}, {"p": "%"}),
        ({"T": "K"}, {"T": "K"}),
        ({"f": "kN", "psi": "deg"}, {"psi": "deg"}),  # what is not drawn may be named
    ],
)
def test_units_are_chosen_by_unit_by_vector_and_by_name(run, display, labels):
    figure = run.plot(*labels, display=display)
    shown = {name: label.rpartition("[")[2].rstrip("]") for name, (label, _) in drawn(figure).items()}
    assert shown == labels


def test_the_time_has_a_unit_too(run):
    for display in ("ms", {"time": "ms"}, {"s": "ms"}):
        axis = run.plot("phi", display=display).axes[-1]
        assert axis.get_xlabel() == "time [ms]"
        assert np.asarray(axis.lines[0].get_xdata(), float)[-1] == 1000.0


@pytest.mark.parametrize(
    ("display", "message"),
    [
        ("bar", r"run: plot: display: found 'bar', a pressure, expected a unit of what is shown: phi in rad, w in rad/s"),
        ("degg", "there is no unit 'degg'; did you mean 'deg'"),
        ({"phi": "mm"}, "run: plot: display: phi: found 'mm', a length, expected an angle in rad; write 'rad', 'deg'"),
        ({"rad": "mm"}, "display: rad: found 'mm', a length, expected an angle"),
        ({"phy": "deg"}, r"found 'phy', expected the name of a variable, or its unit; did you mean 'phi'\?"),
        ({"bare": "mm"}, "found 'mm' for what has no unit, expected none"),
        ({"phi": 3}, "display: phi: found 3, expected a unit as text"),
        (3, "run: plot: found display=3, expected a unit, or {name: unit}"),
    ],
)  # fmt: skip
def test_units_that_cannot_be(run, display: Any, message):
    with pytest.raises(ModelError, match=message) as caught:
        run.plot("phi", "w", display=display)
    assert caught.value.argument == "display"


def header_and_rows(path):
    with path.open(newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    return header, np.array(rows, float)


def test_files_are_in_si_unless_other_units_are_asked_for(run, tmp_path):
    header, rows = header_and_rows(run.save(tmp_path / "x.csv"))
    assert header[:4] == ["time [s]", "phi [rad]", "psi [rad]", "r[0] [m]"]
    assert np.array_equal(rows[:, 1], run["phi"])  # to the last digit
    header, _ = header_and_rows(run.save(tmp_path / "y.csv", display={"psi": "rev"}))
    assert header[1:4] == ["phi [rad]", "psi [rev]", "r[0] [m]"]


@pytest.mark.parametrize(
    "display", ["declared", {"rad": "deg", "rad/s": "rpm", "m": "um", "kg": "lb", "p": "%"}]
)
def test_files_in_other_units_read_back_to_si(run, tmp_path, display):
    read = Columns.read(run.save(tmp_path / "x.csv", display=display))
    assert "phi [deg]" in read.header
    assert not {"phi [rad]", "minus [rad]", "r[0] [m]"} & set(read.header)
    for name in read.names:
        values = read.column(name)
        assert np.max(np.abs(values - run[name]) / np.spacing(np.maximum(np.abs(run[name]), 1e-300))) <= 2.0


def test_other_formats_hold_si(run, tmp_path):
    with pytest.raises(ModelError, match=r"expected none: '\.nc' holds SI") as caught:
        run.save(tmp_path / "x.nc", display="deg")
    assert caught.value.argument == "display"
    assert run.save(tmp_path / "x.mat", display="SI").is_file()


def test_a_selection_keeps_what_is_declared(run):
    chosen = run.select(["phi", "r"])
    assert (chosen.display("phi"), chosen.display("r"), chosen.display("r[1]")) == ("deg", "mm", "mm")


def test_absolute_zero_is_no_border_for_what_is_shown():
    """A result may be wrong; a figure of it shows what it is."""
    cold = Result([0.0, 1.0], {"T": [-5.0, 0.0]}, units={"T": "K"}, displays={"T": "degC"})
    assert drawn(cold.plot("T"))["T"][1].tolist() == [-278.15, -273.15]
    assert si(-273.15, "degC") == 0.0
