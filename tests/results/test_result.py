"""Results: lookup by name, figures, and files that read back to the same numbers."""

import csv
import sys
from collections.abc import Mapping

import matplotlib
import numpy as np
import pytest

from gantrytau.border.refusal import GantryTauError, ModelError
from gantrytau.results.result import Result
from gantrytau.results.series import split_element

matplotlib.use("Agg")

TIME = np.linspace(0.0, 1.0, 11)
POSITION = np.stack([np.cos(TIME), np.sin(TIME), TIME / 3.0], axis=1)


@pytest.fixture
def circle():
    """A tool on a circle; its mass is constant and the force of its support is an alias."""
    values = {f"tool.r[{k}]": POSITION[:, k] for k in range(3)}
    values |= {f"R[{i},{j}]": TIME * (3 * i + j) for i in range(3) for j in range(3)}
    values |= {"tool.m": 9.13, "tool.f": np.sin(5 * TIME)}
    return Result(
        TIME,
        values,
        units={"tool.r": "m", "tool.m": "kg", "tool.f": "N"},
        descriptions={"tool.r": "position of the tool, world frame", "tool.m": "mass"},
        title="circle",
        aliases={"support.f": "-tool.f", "body.m": "tool.m"},
    )


def test_scalars_vectors_and_matrices_answer_by_name(circle):
    np.testing.assert_array_equal(circle["tool.r"], POSITION)
    np.testing.assert_array_equal(circle["tool.r[1]"], POSITION[:, 1])
    assert circle["R"].shape == (11, 3, 3)
    np.testing.assert_array_equal(circle["R"][:, 2, 1], circle["R[2,1]"])
    np.testing.assert_array_equal(circle["tool.m"], np.full(11, 9.13))
    np.testing.assert_array_equal(circle["time"], TIME)
    assert circle.final("tool.m") == 9.13
    assert isinstance(circle.final("tool.m"), float)
    np.testing.assert_array_equal(circle.final("tool.r"), POSITION[-1])


def test_an_alias_equals_its_target_with_its_sign(circle):
    np.testing.assert_array_equal(circle["support.f"], -circle["tool.f"])
    np.testing.assert_array_equal(circle["body.m"], circle["tool.m"])
    assert circle.unit("support.f") == "N"


def test_units_and_descriptions_pass_from_vectors_to_elements(circle):
    assert circle.units["tool.r[2]"] == circle.units["tool.r"] == "m"
    assert circle.unit("R[0,0]") == circle.unit("R") == ""
    assert circle.description("tool.r[0]") == "position of the tool, world frame"
    assert Result([0.0], {"r[0]": 1.0}, units={"r[0]": "m"}).unit("r") == "m"


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("tool.r[2]", ("tool.r", (2,))),
        ("der(der(tool.r[2]))", ("der(der(tool.r))", (2,))),
        ("der(tool.r)[2]", ("der(tool.r)", (2,))),
        ("R[0, 1]", ("R", (0, 1))),
        ("carts[0].s", None),
        ("der(carts[0].s)", None),
    ],
)
def test_element_names_are_split_at_their_last_index(name, parts):
    assert split_element(name) == parts


def test_an_incomplete_vector_has_no_name_of_its_own():
    partial = Result([0.0, 1.0], {"r[0]": 1.0, "r[2]": 2.0})
    assert "r[2]" in partial
    assert "r" not in partial


class Counted(Mapping):
    """Computes an entry when asked, and counts how often."""

    def __init__(self, names):
        self.names, self.asked = names, []

    def __getitem__(self, name):
        self.asked.append(name)
        return np.zeros(2)

    def __iter__(self):
        return iter(self.names)

    def __len__(self):
        return len(self.names)


def test_values_are_computed_when_wanted_and_once():
    values = Counted([f"x[{k}]" for k in range(1000)] + ["y"])
    result = Result([0.0, 1.0], values)
    assert "y" in result
    assert len(result.names) == 1001
    assert values.asked == []
    assert result.final("y") == result["y"][-1]
    assert values.asked == ["y"]


def test_a_result_cannot_be_changed(circle):
    for name in ("tool.f", "tool.r", "support.f", "body.m", "time"):
        with pytest.raises(ValueError, match="read-only"):
            circle[name][0] = 1.0
    with pytest.raises(AttributeError):
        circle.time = TIME


def test_repr_says_what_and_how_much(circle):
    assert repr(circle).startswith("<Result circle: 16 variables at 11 times from 0 s to 1 s: tool.r[0], ")


@pytest.mark.parametrize("lookup", ["__getitem__", "final", "unit", "description", "plot"])
def test_an_unknown_name_raises_and_offers_the_closest(circle, lookup):
    with pytest.raises(ModelError, match=r"circle has no variable 'tol\.r'; did you mean 'tool\.r'"):
        getattr(circle, lookup)("tol.r")


def test_a_list_of_names_is_no_name(circle):
    with pytest.raises(ModelError, match=r"found name=\['tool\.r', 'phi'\], expected one name"):
        circle.plot(["tool.r", "phi"])


@pytest.mark.parametrize("time", [[], [0.0, 2.0, 1.0], [[0.0, 1.0]], [0.0, np.nan]])
def test_times_that_are_no_grid_raise(time):
    with pytest.raises(ModelError, match="never decreases"):
        Result(time, {})


def test_values_off_the_time_grid_and_aliases_of_nothing_raise():
    with pytest.raises(ModelError, match=r"x has values of shape \(3,\)"):
        Result([0.0, 1.0], {"x": np.zeros(3)})["x"]
    with pytest.raises(ModelError, match="alias 'y' names '-z'"):
        Result([0.0, 1.0], {"x": 1.0}, aliases={"y": "-z"})


def test_plot_draws_one_axis_for_each_unit(circle, tmp_path):
    figure = circle.plot("tool.r", "tool.f", "support.f", file=tmp_path / "circle.png")
    positions, forces = figure.axes
    assert [len(positions.lines), len(forces.lines)] == [3, 2]
    assert positions.get_ylabel() == "[m]"
    assert forces.get_xlabel() == "time [s]"
    np.testing.assert_array_equal(positions.lines[1].get_ydata(), POSITION[:, 1])
    assert (tmp_path / "circle.png").read_bytes().startswith(b"\x89PNG")
    assert circle.plot("tool.m").axes[0].get_ylabel() == "tool.m [kg]"


def test_plot_of_everything_is_for_few_variables(circle):
    with pytest.raises(ModelError, match=r"found 16 variables, expected 1 to 12; name those"):
        circle.plot()
    assert len(Result(TIME, {"x": TIME, "y": 1.0}).plot().axes[0].lines) == 2


def test_csv_reads_back_exactly(circle, tmp_path):
    path = circle.save(tmp_path / "circle.csv")
    with path.open(newline="") as file:
        header, *rows = csv.reader(file)
    assert header[:2] == ["time [s]", "tool.r[0] [m]"]
    assert header[4] == "R[0,0]"
    columns = np.array(rows, dtype=float).T
    for name, column in zip(("time", *circle.names), columns, strict=True):
        np.testing.assert_array_equal(column, circle[name])


def test_netcdf_keeps_vectors_and_units(circle, tmp_path):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    with xarray.open_dataset(circle.save(tmp_path / "circle.nc"), engine="h5netcdf") as data:
        np.testing.assert_array_equal(data["tool.r"], POSITION)
        assert data["tool.r"].attrs == {"units": "m", "long_name": "position of the tool, world frame"}
        np.testing.assert_array_equal(data["R"], circle["R"])
        np.testing.assert_array_equal(data["time"], TIME)
        assert data.attrs["title"] == "circle"
    assert circle.to_xarray()["tool.f"].dims == ("time",)


def test_parquet_keeps_names_and_units(circle, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    table = parquet.read_table(circle.save(tmp_path / "circle.parquet"))
    assert table.column_names == ["time", *circle.names]
    np.testing.assert_array_equal(table["tool.r[1]"].to_numpy(), POSITION[:, 1])
    assert table.schema.field("tool.r[1]").metadata[b"units"] == b"m"


def test_dymola_trajectory_follows_its_layout(circle, tmp_path):
    from scipy.io import loadmat

    file = loadmat(circle.save(tmp_path / "circle.mat"), chars_as_strings=False)
    letters = ["".join(row).rstrip() for row in file["Aclass"]]
    assert letters == ["Atrajectory", "1.1", "circle", "binTrans"]
    names = ["".join(column).rstrip() for column in file["name"].T]
    texts = ["".join(column).rstrip() for column in file["description"].T]
    assert names == ["Time", *circle.names]
    assert texts[1] == "position of the tool, world frame [m]"
    assert tuple(file["dataInfo"][:, 0]) == (0, 1, 0, -1)
    for name, (matrix, row, *_) in zip(names[1:], file["dataInfo"].T[1:], strict=True):
        data = file[f"data_{matrix}"]
        times = data[0]
        np.testing.assert_array_equal(np.sign(row) * data[abs(row) - 1], np.interp(times, TIME, circle[name]))


@pytest.mark.parametrize(
    ("name", "words"),
    [("circle.cvs", r"'\.cvs', .*did you mean '\.csv'"), ("none/circle.csv", "does not exist; create")],
)
def test_a_file_that_cannot_be_written_is_refused(circle, tmp_path, name, words):
    with pytest.raises(ModelError, match=words):
        circle.save(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("suffix", "module"), [(".nc", "xarray"), (".nc", "h5py"), (".parquet", "pyarrow")])
def test_a_missing_extra_says_how_to_install_it(circle, tmp_path, monkeypatch, suffix, module):
    if module == "h5py":
        pytest.importorskip("h5netcdf")
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(GantryTauError, match=rf"{module}: not installed.*pip install 'gantrytau\[results\]'"):
        circle.save(tmp_path / f"circle{suffix}")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", [".csv", ".nc", ".parquet", ".mat"])
def test_a_failing_save_leaves_the_old_file_alone(tmp_path, suffix):
    if suffix in (".nc", ".parquet"):
        pytest.importorskip("xarray")
        pytest.importorskip("pyarrow")
    path = tmp_path / f"old{suffix}"
    path.write_text("old")
    with pytest.raises(ModelError, match="bad has values of shape"):
        Result([0.0, 1.0], {"good": 1.0, "bad": np.zeros(3)}).save(path)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]
