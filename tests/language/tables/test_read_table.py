"""Curves and maps from CSV files, in the ways that spreadsheets write them."""

import numpy as np
import pytest

from gantrytau import ModelError, read_table, table


def written(folder, text):
    path = folder / "curve.csv"
    path.write_text(text, encoding="utf-8-sig")
    return path


@pytest.mark.parametrize(
    "text",
    ["angle,torque\n0,0.5\n1.5,2\n", "angle;torque\n0;0,5\n1,5;2\n\n", "angle\ttorque\n0\t0.5\n1,5\t2\n"],
)
def test_a_curve_is_read_with_commas_semicolons_and_tabs(tmp_path, text):
    xs, ys = read_table(written(tmp_path, text))
    assert xs.tolist() == [0.0, 1.5]
    assert ys.tolist() == [0.5, 2.0]
    assert table(0.75, xs, ys) == 1.25


def test_two_columns_are_chosen_by_name(tmp_path):
    path = written(tmp_path, "name;speed;torque\na;1;2\nb;2;7\n")
    assert table(1.5, *read_table(path, columns=("speed", "torque"))) == 4.5


def test_units_in_the_header_become_si(tmp_path):
    (tmp_path / "law.csv").write_text("v [mm/s],f [kN]\n100,0.5\n200,1\n")
    x, y = read_table(tmp_path / "law.csv", columns=("v", "f"))
    assert np.array_equal(x, [0.1, 0.2])
    assert np.array_equal(y, [500.0, 1000.0])


def test_a_map_is_read_whole(tmp_path):
    (xs, ys), values = read_table(written(tmp_path, ";0;10,5;20\n1;1;2;3\n2;4;5;6\n"))
    assert xs.tolist() == [1, 2]
    assert ys.tolist() == [0, 10.5, 20]
    assert np.array_equal(values, [[1, 2, 3], [4, 5, 6]])
    assert table((1.5, 10.5), (xs, ys), values) == 3.5


@pytest.mark.parametrize(
    ("text", "words"),
    [  # what no column can be is refused as by any reader of columns
        ("x [mm],0,1\n0,1,2\n", r"curve.csv: found 'x \[mm\]', expected a map without units, in SI"),
        ("a,b,c\n1,2,3\n", "curve.csv: found the columns a, b, c, expected two of a curve; name them"),
    ],
)
def test_a_file_that_is_no_table_is_refused(tmp_path, text, words):
    with pytest.raises(ModelError, match=words):
        read_table(written(tmp_path, text))
