"""Results, optima and studies as tables of pandas and datasets of xarray: the same numbers, names, units, gaps."""

import sys
from typing import Any

import numpy as np
import pandas as pd
import pytest

from gantrytau import GantryTauError, Mode, Model, ModelError, Real, Result, der, simulate, transition
from gantrytau_models import Pendulum

TIME = np.linspace(0.0, 1.0, 5)


@pytest.fixture
def motion():
    """A tool over time, an angle, an alias, a constant."""
    values = {f"tool.r[{k}]": TIME * (k + 1) for k in range(3)}
    values |= {"phi": TIME * np.pi, "m": 9.13}
    units, words = {"tool.r": "m", "phi": "rad", "m": "kg"}, {"tool.r": "position of the tool"}
    own: dict[str, Any] = dict(aliases={"opposite": "-phi"}, displays={"phi": "deg"})
    return Result(TIME, values, units=units, descriptions=words, title="motion", **own)


def test_every_scalar_is_a_column_over_time(motion):
    frame = motion.to_pandas()
    assert list(frame.columns) == list(motion.names)
    assert frame.index.name == "time"
    np.testing.assert_array_equal(frame.index, TIME)
    for name in motion.names:
        np.testing.assert_array_equal(frame[name], motion[name])
    tool = {f"tool.r[{k}]": "m" for k in range(3)}
    assert frame.attrs["units"] == {"time": "s", **tool, "phi": "rad", "m": "kg", "opposite": "rad"}
    assert frame.attrs["descriptions"]["tool.r[1]"] == "position of the tool"
    assert (frame.attrs["title"], frame.attrs["ended"]) == ("motion", "stop")


def test_names_choose_columns_in_their_order(motion):
    columns = list(motion.to_pandas("m", "tool.r", "tool.r[0]", "time").columns)
    assert columns == ["m", *(f"tool.r[{k}]" for k in range(3))]
    with pytest.raises(ModelError, match=r"has no variable 'tool\.q'; did you mean 'tool\.r'"):
        motion.to_pandas("tool.q")
    with pytest.raises(ModelError) as error:
        motion.to_pandas(["m"])  # pyright: ignore[reportArgumentType]
    assert error.value.argument == "names"


def test_units_may_be_others(motion):
    frame = motion.to_pandas("phi", "tool.r", display={"phi": "deg", "m": "mm", "time": "ms"})
    assert frame["phi"].iloc[-1] == pytest.approx(180.0)
    assert frame.index[-1] == pytest.approx(1000.0)
    assert frame.attrs["units"]["phi"] == "deg"
    assert frame.attrs["units"]["tool.r[2]"] == "mm"
    assert frame["tool.r[2]"].iloc[-1] == pytest.approx(3000.0)
    assert motion.to_pandas("phi", display="declared").attrs["units"]["phi"] == "deg"


def test_a_table_reads_back_from_csv(motion, tmp_path):
    motion.save(tmp_path / "motion.csv")
    frame = pd.read_csv(tmp_path / "motion.csv", index_col=0)
    np.testing.assert_array_equal(frame.to_numpy(), motion.to_pandas().to_numpy())


def test_times_of_jumps_stand_twice():
    class Ball(Model):
        """A ball that is caught."""

        h = Real(unit="m", start=1.0, fixed=True)
        mode = Mode("flying", "caught")

        def equations(self):
            yield der(self.h) == self.mode.choose(flying=-2.0, caught=0.0)
            yield transition(self.mode, "flying", "caught", self.h <= 0.5)

    fall = simulate(Ball(), stop=1.0)
    frame = fall.to_pandas("h", "mode")
    assert frame.attrs["modes"] == {"mode": ["flying", "caught"]}
    caught = frame.loc[abs(frame.index.to_numpy() - 0.25) < 1e-6, "mode"]
    assert sorted(caught) == [0.0, 1.0]
    assert frame["h"].iloc[-1] == pytest.approx(0.5, abs=1e-6)


def test_numbers_are_those_of_a_simulation():
    swing = simulate(Pendulum(), stop=1.0)
    frame = swing.to_pandas()
    energy = frame["kinetic_energy"] + frame["potential_energy"]
    assert np.ptp(energy) < 1e-6 * abs(energy.iloc[0])  # a hundred times the tolerance
    assert swing.to_xarray()["x"].attrs["units"] == frame.attrs["units"]["x"] == "m"


def test_without_pandas_the_error_says_how_to_get_it(motion, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(GantryTauError, match=r"pandas: not installed.*pip install 'gantrytau\[results\]'"):
        motion.to_pandas()


def test_an_empty_result_is_an_empty_table():
    frame = Result([0.0], {}).to_pandas()
    assert frame.shape == (1, 0)
