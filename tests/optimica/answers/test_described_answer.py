"""What `describe` and notebooks say of optima: one phase, two, saved ones, and those that failed."""

import numpy as np
import pytest

from gantrytau import ModelError, SolveError, describe
from gantrytau_optimica import Optimum, final, load_optimum, optimize, prepare
from tests.optimica.answers.test_answers import Move, TwoMoves


class Unreachable(Move):
    """Ends where nothing comes to in time."""

    def constraints(self):
        yield from super().constraints()
        yield final(self.cart.r)[0] >= 1000.0


@pytest.fixture(scope="module")
def move():
    return optimize(Move(), elements=8)


def test_an_optimum_is_told_by_its_numbers_and_variables(move, tmp_path):
    move.save(tmp_path / "move.optimum")
    for answer in (move, load_optimum(tmp_path / "move.optimum")):
        said = describe(answer)
        free = {row["name"]: row for row in said.as_mapping()["Free numbers"]}
        assert float(free["final_time"]["value"]) == pytest.approx(move.final_time, rel=1e-7)
        assert free["final_time"]["unit"] == "s"
        rows = {row["name"]: row for row in said.as_mapping()["Variables"]}
        assert np.array(eval(rows["cart.r[2]"]["at the end"])) == pytest.approx(
            move.final("cart.r"), abs=1e-6
        )
        assert dict(said.facts)["ended"] == move.status
        assert "<table>" in answer._repr_html_()
        assert dict(describe(answer, "final_time").facts)["unit"] == "s"
        assert describe(answer, "cart.v[0]").summary == "speed"
        with pytest.raises(ModelError, match=r"cart\.w"):
            describe(answer, "cart.w")


def test_phases_are_told_one_by_one():
    said = describe(optimize(TwoMoves(), elements=6)).as_mapping()
    assert [row["name"] for row in said["Phases"]] == ["onward", "first"]
    assert said["Phases"][1]["to s"] == said["Phases"][0]["from s"]
    assert {"Variables of onward", "Variables of first"} <= said.keys()


def test_what_failed_says_so():
    with pytest.raises(SolveError) as error:
        optimize(Unreachable(), elements=4)
    failed = error.value.optimum
    assert isinstance(failed, Optimum)
    assert not failed.success
    assert "which is no success" in dict(describe(failed).facts)["ended"]
    assert "no success" in failed._repr_html_()


def test_problems_and_prepared_ones_are_short(move):
    assert repr(Move(final_time=2.5)) == "Move(final_time=2.5)"
    assert "comes to rest" in Move()._repr_html_()
    prepared = prepare(Move(), elements=8)
    assert len(prepared._repr_html_()) < 3000


def test_optima_become_tables(move):
    frame = move.to_pandas("cart.r")
    assert list(frame.columns) == ["cart.r[0]", "cart.r[1]"]
    np.testing.assert_array_equal(frame.index, move.time)
    np.testing.assert_array_equal(frame.to_numpy(), move["cart.r"])
    assert move.to_xarray()["cart.v"].attrs["units"] == "m/s"


def test_phases_are_one_table_with_gaps():
    moves = optimize(TwoMoves(), elements=6)
    frame = moves.to_pandas()
    first = moves.phases["first"]
    after = frame.index.to_numpy() > first.final_time + 1e-9
    assert np.isnan(frame["first.cart.r[0]"].to_numpy()[after]).all()
    assert np.isfinite(frame["onward.cart.r[0]"].to_numpy()[after]).all()
