"""Studies as tables: units of what varies, cases that failed and why, final values, what functions return."""

import sys

import numpy as np
import pytest

from gantrytau import GantryTauError, Model, ModelError, Parameter, Real, Study, der, require, study


class Decay(Model):
    """x' = -k x, for rates above zero."""

    k = Parameter(1.0, unit="1/s", description="rate")
    r = Real(2, unit="m", description="place")
    x = Real(unit="m", start=1.0, fixed=True, description="height")

    def equations(self):
        yield require(self.k > 0, "expected a rate above zero")
        yield der(self.x) == -self.k * self.x
        yield self.r[0] == self.x
        yield self.r[1] == 2 * self.x


@pytest.fixture(scope="module")
def found():
    return study(Decay(), stop=1.0, over={"k": [-1.0, 1.0, 2.0], "x": [1.0, 3.0]}, tolerance=1e-9)


def test_what_varies_has_units_and_failures_are_told(found):
    table = found.to_xarray()
    assert table["k"].attrs == {"units": "1/s", "long_name": "rate"}
    assert table["x.start"].attrs["units"] == "m"
    assert table["failure"].dims == ("k", "x.start")
    assert np.all(np.isnan(table["x"].sel(k=-1.0)))
    assert all("expected a rate above zero" in str(text) for text in table["failure"].sel(k=-1.0).values)
    assert set(table["failure"].sel(k=2.0).values) == {""}
    exact = table["x.start"] * np.exp(-table["k"] * table["time"])
    good = table["k"] > 0
    assert abs(table["x"] - exact).where(good).max() < 1e-6  # some hundred times the tolerance


def test_failures_are_written_to_a_file(found, tmp_path):
    import xarray

    with xarray.open_dataset(found.save(tmp_path / "decay.nc"), engine="h5netcdf") as table:
        assert "expected a rate above zero" in str(table["failure"].sel(k=-1.0).values[0])
        assert table["k"].attrs["units"] == "1/s"


def test_studies_without_failures_have_no_column_of_them():
    table = study(Decay(), stop=0.1, over={"k": [1.0, 2.0]}).to_xarray()
    assert "failure" not in table.coords


def test_cases_are_rows(found):
    frame = found.to_pandas("x", "r")
    assert list(frame.columns) == ["k", "x.start", "x", "r[0]", "r[1]", "failure"]
    assert len(frame) == 6
    good = frame[frame["failure"] == ""]
    np.testing.assert_allclose(good["x"], good["x.start"] * np.exp(-good["k"]), atol=1e-6)
    np.testing.assert_allclose(good["r[1]"], 2 * good["x"], atol=1e-12)
    assert np.all(np.isnan(frame.loc[frame["k"] == -1.0, "x"]))
    assert frame.attrs["units"] == {"k": "1/s", "x.start": "m", "x": "m", "r[0]": "m", "r[1]": "m"}
    assert list(found.to_pandas().columns) == ["k", "x.start", "failure"]
    assert list(found.to_pandas("k").columns) == ["k", "x.start", "final k", "failure"]
    with pytest.raises(ModelError, match="has no variable 'z'"):
        found.to_pandas("z")


def test_what_was_not_finished_is_told(found):
    left = Study(
        found.title, found.axes, found.cases, {k: found.outcomes[k] for k in list(found.outcomes)[:-1]}
    )
    assert left.to_pandas()["failure"].iloc[-1] == "not finished"
    assert left.to_xarray()["failure"].values[-1, -1] == "not finished"
    nothing = Study(found.title, found.axes, found.cases, {})
    assert set(nothing.to_pandas()["failure"]) == {"not finished"}
    with pytest.raises(ModelError, match=r"no case has a result; look at \.failures"):
        nothing.to_pandas("x")


def area(a: float, b: float) -> float:
    """The area of a rectangle."""
    return a * b


def sides(a: float) -> dict[str, float]:
    """A square."""
    if a < 0:
        raise ValueError("no such square")
    return {"area": a * a, "round": 4 * a}


def test_functions_have_their_values_as_columns():
    frame = study(area, over={"a": [1.0, 2.0], "b": [3.0, 4.0]}, combine="zip").to_pandas()
    assert frame["value"].tolist() == [3.0, 8.0]
    with pytest.raises(ModelError, match="which has none; leave them out") as error:
        study(area, over={"a": [1.0], "b": [3.0]}).to_pandas("area")
    assert error.value.argument == "names"
    squares = study(sides, over={"a": [-1.0, 2.0]})
    assert squares.to_pandas()["area"].tolist()[1:] == [4.0]
    assert np.isnan(squares.to_pandas("round")["round"][0])
    assert "ValueError: " in squares.to_pandas()["failure"][0]
    with pytest.raises(ModelError, match="found 'aria', expected one of area, round"):
        squares.to_pandas("aria")


def test_seeds_are_a_column():
    frame = study(Decay(), stop=0.1, over={"k": [1.0]}, seeds=3).to_pandas()
    assert frame["seed"].tolist() == [0, 1, 2]


def test_without_pandas_the_error_says_how_to_get_it(found, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(GantryTauError, match=r"pandas: not installed.*pip install 'gantrytau\[results\]'"):
        found.to_pandas()
