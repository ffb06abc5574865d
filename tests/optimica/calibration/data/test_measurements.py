"""Measurements as arrays and from files."""

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_optimica import Measurements
from gantrytau_optimica.fitting.finding import rows_in_words
from tests.optimica.refusals import refused

RNG = np.random.default_rng(0)
Q, T = RNG.uniform(size=(12, 3)), RNG.uniform(size=(12, 3))
U = RNG.normal(size=(12, 4))


def write(path, header, table):
    lines = [header, *(",".join(f"{x!r}" for x in row.tolist()) for row in table)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_a_file_says_what_the_arrays_say(tmp_path):
    path = write(tmp_path / "m.csv", "q1,q2,q3,x,y,z,qw,qx,qy,qz", np.hstack([Q, T, U]))
    read = Measurements.read(path)
    assert np.array_equal(read.q, Q)
    assert np.array_equal(read.r, T)
    assert read.R is not None
    assert np.einsum("nij,nkj->nik", read.R, read.R) == pytest.approx(np.tile(np.eye(3), (12, 1, 1)))
    # a quaternion turns a vector as its matrix does: u v u* by hand
    w, u = U[0, 0] / np.linalg.norm(U[0]), U[0, 1:] / np.linalg.norm(U[0])
    v = np.array([1.0, 2.0, 3.0])
    turned = v + 2 * w * np.cross(u, v) + 2 * np.cross(u, np.cross(u, v))
    assert read.R[0] @ v == pytest.approx(turned)


def test_positions_only_and_guideways(tmp_path):
    path = write(tmp_path / "m.csv", "q1,q2,q3,x,y,z", np.hstack([Q, T]))
    rail = np.column_stack([[0.5, 0.0, 1.0], [0.5, 0.0, 1.0], np.zeros(3), np.zeros(3)])
    rails = [write(tmp_path / f"rail{k}.csv", "q,x,y,z", rail) for k in range(3)]
    read = Measurements.read(path, rails)
    assert read.R is None
    assert read.rails is not None
    assert np.array_equal(read.rails[0][:, 0], [0.0, 0.5, 1.0])  # sorted
    assert "3 guideways" in repr(read)


def test_columns_are_known_by_their_names(tmp_path):
    path = tmp_path / "m.csv"
    text = "number,y,x,z,q2,q1,remark,measured\n4,5,4,6,2,1,warm,1\n9,0,0,0,0,0,passed,0\n\n7,50,40,60,20,10,,1\n"
    path.write_text(text, encoding="utf-8")
    read = Measurements.read(path)
    assert read.q.tolist() == [[1, 2], [10, 20]]
    assert read.r.tolist() == [[4, 5, 6], [40, 50, 60]]
    assert read.numbers.tolist() == [4, 7]  # type: ignore[union-attr]
    assert read.lines.tolist() == [2, 5]  # type: ignore[union-attr]
    assert read.select([1]).numbers.tolist() == [7]  # type: ignore[union-attr]


@pytest.mark.parametrize("separator", [";", "\t"])
def test_spreadsheets_with_decimal_commas(tmp_path, separator):
    path = write(tmp_path / "m.csv", "q1,q2,q3,x,y,z", np.hstack([Q, T]))
    text = path.read_text(encoding="utf-8").replace(",", separator).replace(".", ",")
    (tmp_path / "n.csv").write_text("\ufeff" + text, encoding="utf-8")
    assert np.array_equal(Measurements.read(tmp_path / "n.csv").r, Measurements.read(path).r)


def test_arrays_cannot_be_changed_later():
    q = Q.copy()
    measurements = Measurements(q, T)
    q[0, 0] = 9.0
    assert measurements.q[0, 0] == Q[0, 0]
    with pytest.raises(ValueError, match="read-only"):
        measurements.r[0, 0] = 1.0


def test_empty_cells_are_nan(tmp_path):
    path = tmp_path / "m.csv"
    path.write_text("q1,q2,q3,x,y,z\n" + "1,2,3,4,,6\n" + "1,2,3,4,5,6\n", encoding="utf-8")
    assert [f.rows.tolist() for f in Measurements.read(path).findings if f.kind == "nan"] == [[0]]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "found 0 lines, expected a header and one line for each pose"),
        ("a,b,c\n1,2,3\n", "header a,b,c: found no column q1, x, y, z"),
        ("q1,q3,x,y,z\n1,2,3,4,5\n", "found no column q2"),
        ("q1,q2,q3,x,y,Z\n1,2,3,4,5,6\n", "found no column z"),
        ("q1,q2,q3,x,y,z,qw\n1,2,3,4,5,6,7\n", "found no column qx, qy, qz"),
        ("q1,q2,q3,x,y,z,x\n1,2,3,4,5,6,7\n", "found 2 columns 'x'"),
        ("q1,q2,q3,x,y,z\n1,0,2,0,3,0,4,0,5,0,6,0\n", "line 2 has 12 cells.*separate cells by semicolons"),
        ("q1;q2;q3;x;y;z\n1;2;3;4;5,5;1.234,5\n", "line 2, column z: found '1.234,5'.*between thousands"),
        ("q1,q2,q3,x,y,z\n1,2,3,4,5\n", "line 2 has 5 cells"),
        ("q1,q2,q3,x,y,z\n1,2,3,4,5,six\n", "line 2, column z: found 'six'"),
    ],
)
def test_files_that_are_no_measurements(tmp_path, text, words):
    path = tmp_path / "m.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ModelError, match=words):
        Measurements.read(path)


def test_files_that_are_not_there(tmp_path):
    with pytest.raises(ModelError, match="no file"):
        Measurements.read(tmp_path / "none.csv")
    path = write(tmp_path / "m.csv", "q1,q2,q3,x,y,z", np.hstack([Q, T]))
    wrong = write(tmp_path / "rail.csv", "s,x,y,z", np.hstack([Q[:, :1], T]))
    with pytest.raises(ModelError, match="of a guideway"):
        Measurements.read(path, [wrong] * 3)


@pytest.mark.parametrize(
    ("argument", "arguments"),
    [
        ("r", (Q, T[:5])),
        ("q", (Q[0], T[0])),
        ("r", (Q, [["a", "b", "c"]])),
        ("R", (Q, T, np.eye(3))),
        ("rails[0]", (Q, T, None, [Q])),
        ("rails[0]", (Q, T, None, [np.ones((3, 4))])),  # several points at one q
    ],
)
def test_shapes_that_do_not_fit(argument, arguments):
    with refused(argument):
        Measurements(*arguments)


def test_guideways_in_millimetres_are_found():
    rail = np.column_stack([np.linspace(0, 1, 10), 1e3 * np.linspace(0, 1, 10), np.zeros(10), np.zeros(10)])
    spread = RNG.uniform(size=(12, 3))
    assert [f.kind for f in Measurements(spread, spread, None, [rail] * 3).findings] == ["guideway"] * 3


@pytest.mark.parametrize(
    ("rows", "of", "words"),
    [
        ([3], 10, "row 3"),
        ([3, 4], 10, "rows 3 and 4"),
        ([3, 4, 9], 10, "rows 3, 4 and 9"),
        ([3, 4, 5, 6, 12, *range(20, 32)], 40, "rows 3 to 6, 12 and 20 to 31"),
        (range(779), 779, "rows 0 to 778"),
        ([*range(154), *range(210, 779)], 779, "all but rows 154 to 209"),
        ([*range(154), *range(155, 779)], 779, "all but row 154"),
        ([*range(154), *range(210, 779)], None, "rows 0 to 153 and 210 to 778"),
        (range(400, 779), 779, "rows 400 to 778"),
        (range(0, 18, 2), 100, "rows 0, 2, 4, 6, 8, 10, 12 and 2 more"),
        (range(0, 100, 2), 100, "rows 0, 2, 4, 6, 8, 10, 12, 14 and 42 more"),
    ],
)
def test_rows_in_words(rows, of, words):
    assert rows_in_words(list(rows), of) == words


def test_one_row_and_many_in_words():
    q, r = (np.random.default_rng(k).uniform(0, 1, (30, 3)) for k in (0, 1))
    for bad, words in (
        ([4], "row 4 holds no finite numbers and is"),
        ([4, 6], "rows 4 and 6 hold no finite numbers and are"),
    ):
        broken = r.copy()
        broken[bad] = np.nan
        assert words in Measurements(q, broken).findings[0].message
    one, two = ([*range(30), *more] for more in ([3], [3, 5]))
    assert "row 30 repeats earlier rows" in Measurements(q[one], r[one]).findings[0].message
    assert "rows 30 and 31 repeat earlier rows" in Measurements(q[two], r[two]).findings[0].message


@pytest.mark.parametrize("content", [b"\x00\x01\xd5\xff", "q1,q2,q3,x,y,z".encode("utf-16")])
def test_files_that_are_no_text(tmp_path, content):
    path = tmp_path / "measurements.csv"
    path.write_bytes(content)
    with pytest.raises(ModelError, match=r"measurements\.csv: cannot be read as text \(.*save it as CSV"):
        Measurements.read(path)


def test_columns_may_be_in_other_units(tmp_path):
    path = tmp_path / "mm.csv"
    path.write_text("q1 [mm],q2 [deg],x [mm],y [m],z [in],note [any],cxx [um2],cxy,cxz,cyy,cyz,czz\n"
                    "700,90,100,0.2,10,7,25,0,0,1e-12,0,1e-12\n")  # fmt: skip
    read = Measurements.read(path)
    assert read.q.tolist() == [[0.7, np.pi / 2]]
    assert read.r.tolist() == [[0.1, 0.2, 0.254]]
    assert read.covariance is not None
    assert read.covariance[0, 0, 0] == pytest.approx(25e-12, rel=1e-15)
    path.write_text("q1 [mm],x [deg],y,z\n700,1,2,3\n")
    with pytest.raises(ModelError, match=r"mm\.csv: column x: found 'deg', an angle, expected a length in m"):
        Measurements.read(path)
    path.write_text("q1 [furlong],x,y,z\n700,1,2,3\n")
    with pytest.raises(ModelError, match=r"column 'q1 \[furlong\]': unit 'furlong': there is no unit"):
        Measurements.read(path)
