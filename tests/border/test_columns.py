"""Tables in CSV files: what programs and spreadsheets write, each read the same way at every place that takes a table."""

import numpy as np
import pytest

from gantrytau import Columns, ModelError
from gantrytau.border.columns import split_heading

TIMES, LENGTHS = [0.0, 0.5, 1.0], [0.001, 0.0025, np.nan]


def read(folder, text, encoding="utf-8"):
    path = folder / "data.csv"
    path.write_text(text, encoding=encoding)
    return Columns.read(path)


@pytest.mark.parametrize(
    "text",
    [
        "time [ms],x [mm],note\n0,1,first\n\n500,2.5,\n1000,,last\n",
        "t (ms);note;x(mm) ;x [mm]\n0;;;1\n500;;;2,5\n1000;a;b;\n",  # x(mm) is a name, as der(m)
        "sep=;\nx [mm];Time\n1;0\n2,5;0,5\n;1\n",
        "x [mm]\ttimestamp\n1,0\t0\n2,5\t0,5\n\t1\n",
        "# a comment\n# x [mm],t\n1,0\n# between\n2.5,0.5\n,1\n",  # as NumPy writes a header
        '"x [mm]","t"\r\n"1","0"\r\n"2.5","0.5"\r\n"","1"\r\n',
        "of a drive\n\nx [mm];t\n1,0;0\n2,5;0,5\n;1",  # with a title
    ],
)
def test_one_table_in_seven_dialects(tmp_path, text):
    for encoding in ("utf-8", "utf-8-sig"):
        table = read(tmp_path, text, encoding)
        assert table.time is not None
        assert table.time.tolist() == TIMES
        assert np.array_equal(table.column("x", "m"), LENGTHS, equal_nan=True)
        assert table.unit("x") == "mm"


def test_headings_have_a_name_and_perhaps_a_unit():
    headings = [
        "phi [deg]",
        "R[0,1]",
        "k [1/s]",
        " x ",
        "u [-]",
        "q1 (mm)",
        "f[N]",
        "der(m)",
        "x (filtered)",
        "n [1]",
    ]
    assert [split_heading(heading) for heading in headings] == [
        ("phi", "deg"), ("R[0,1]", None), ("k", "1/s"), ("x", None), ("u", "-"), ("q1", "mm"), ("f", "N"),
        ("der(m)", None), ("x (filtered)", None), ("n", "1"),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a,x\n", "found 1 lines, expected a header and one line for each row"),
        ("1,2\n3,4\n", "found numbers in the first line, expected the names"),
        ("a,x\n1,2\n3\n", "line 3 has 1 cells, expected 2 as the header"),
        ("a,x\n1,5,2,5\n", "line 2 has 4 cells, expected 2 as the header; where decimals have commas"),
        ("a,x\n1,2\n# no row\n3,four\n", "line 4, column x: found 'four', expected a number"),
        ("a,x\n1,\n", "line 2, column x: found an empty cell, expected a number"),
        ("a,x [deg]\n1,2\n", "column x: found 'deg', an angle, expected a length in m"),
        ("a,x [foo]\n1,2\n", r"column 'x \[foo\]': unit 'foo': there is no unit 'foo'"),
        ("a,y\n1,2\n", "found no column 'x'; there is a, y"),
        ("x,x [mm]\n1,2\n", "found 2 columns 'x', expected different names"),
    ],
)
def test_what_is_no_table_is_refused_with_its_line(tmp_path, text, words):
    with pytest.raises(ModelError, match=rf"data\.csv: {words}"):
        read(tmp_path, text).column("x", "m", filled=True)


def test_rows_keep_their_lines(tmp_path):
    table = read(tmp_path, "a,x\n\n1,2\n# no row\n3,4\n5,6\n")
    assert table.select(table.column("a") > 1).lines.tolist() == [5, 6]


@pytest.mark.parametrize(
    "text", ["t,x,y\n0,1,2\n1,,4\n\n2,,\n", "t;x;name\r\n0;1,5;a\r\n1;;b", "t x\n0  1\n 2 3 \n"]
)
def test_what_numpy_reads_at_once_is_the_same_cell_by_cell(tmp_path, text):
    at_once = read(tmp_path, text)
    by_cells = read(tmp_path, text.replace("0", '"0"', 1))
    assert at_once.numbers
    assert not by_cells.numbers
    assert at_once.lines.tolist() == by_cells.lines.tolist()
    for name in set(at_once.names) - {"name"}:
        assert np.array_equal(at_once.column(name), by_cells.column(name), equal_nan=True)
        assert at_once.texts(name) == by_cells.texts(name)
