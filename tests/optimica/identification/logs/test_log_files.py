"""Logs on file: names, units, decimal commas, what cannot be read."""

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_optimica import MotionLog

NUMBERS = np.random.default_rng(1).normal(size=(6, 9))
NUMBERS[:, 0] = np.arange(6) * 0.004


def written(tmp_path, header, rows=NUMBERS, separator=",", decimal="."):
    lines = [
        separator.join(header),
        *(separator.join(f"{x:.17g}".replace(".", decimal) for x in row) for row in rows),
    ]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "header",
    [
        "t q1 q2 q3 f1 f2 f3 other more",
        "Time Q1 Q2 Q3 F1 F2 F3 other more",
        "time q[0] q[1] q[2] tau[0] tau[1] tau[2] other more",
        "t carts[0].s carts[1].s carts[2].s carts[0].f carts[1].f carts[2].f arms[0].rail.axis.s arms[0].rail.axis.f",
        "t[s] cart1.position[m] cart2.position[m] cart3.position[m] cart1.force cart2.force cart3.force a b",
    ],
)
def test_columns_are_known_by_several_spellings(tmp_path, header):
    log = MotionLog.read(written(tmp_path, header.split()))
    assert np.array_equal(np.column_stack([log.t, log.q, log.f]), NUMBERS[:, :7])
    assert log.v is None
    assert log.r is None


@pytest.mark.parametrize(
    ("separator", "decimal"), [(";", ","), ("\t", ","), (";", "."), (" ", "."), (",", ".")]
)
def test_separators_and_decimal_commas(tmp_path, separator, decimal):
    header = ["f1", "z", "y", "x", "v1", "q1", "a", "b", "t"]
    log = MotionLog.read(written(tmp_path, header, NUMBERS[:, ::-1], separator, decimal))
    kept = NUMBERS[:, ::-1]
    assert np.array_equal(log.t, NUMBERS[:, 0])
    assert np.array_equal(log.r, kept[:, [3, 2, 1]])
    assert np.array_equal(np.column_stack([log.f, log.v, log.q]), kept[:, [0, 4, 5]])


def test_units_in_the_header_make_si(tmp_path):
    header = [
        "t [ms]",
        "q1 [mm]",
        "q2 (deg)",
        "carts",
        "f1 [kN]",
        "f2 [N.m]",
        "v1 [mm/s]",
        "v2 [rad/s]",
        "x1",
    ]
    log = MotionLog.read(written(tmp_path, header))
    factors = np.array([1e-3, 1e-3, np.pi / 180, 1, 1e3, 1, 1e-3, 1])
    found = np.column_stack([log.t, log.q, log.t, log.f, log.v])
    kept = [0, 1, 2, 4, 5, 6, 7]
    assert np.allclose(
        found[:, [0, 1, 2, 4, 5, 6, 7]], (NUMBERS[:, :8] * factors)[:, kept], rtol=1e-15, atol=0
    )


def test_a_log_that_is_saved_is_read_to_the_last_digit(tmp_path):
    log = MotionLog(NUMBERS[:, 0], NUMBERS[:, 1:3], NUMBERS[:, 3:5], v=NUMBERS[:, 5:7] / 3, r=NUMBERS[:, 6:])
    back = MotionLog.read(log.save(tmp_path / "log.csv"))
    for name in ("t", "q", "f", "v", "r"):
        assert np.array_equal(getattr(log, name), getattr(back, name))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("t,q1,q3,f1,f2,f3\n0,1,2,3,4,5\n", "found no column of position 2.*not all logged"),
        ("t,q1,q2,f1\n0,1,2,3\n", "found no column of force 2"),
        ("q1,f1\n1,2\n", "found no columns of time"),
        ("t,q1\n0,1\n", "found no columns of forces; expected t,q1"),
        ("t,q1,Q1,f1\n0,1,2,3\n", "found q1 and Q1, expected one column for each"),
        ("t,q1 [mm],f1 [N.m]\n0,1,2\n", "divide torques of motors"),
        ("t,q1,f1,x,z\n0,1,2,3,4\n", "found x, z of the tool position, expected x, y, z"),
        ("t,a.s,a.f,b.s,b.f\n0,1,2,3,4\n", "found positions and forces of a and of b"),
    ],
)
def test_what_is_no_log_is_refused(tmp_path, text, words):
    path = tmp_path / "log.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ModelError, match=words):
        MotionLog.read(path)


def test_rows_are_found_again_as_lines_of_the_file(tmp_path):
    file = tmp_path / "log.csv"
    file.write_text("of Monday\n\nt,q1,f1\n0,1,2\n\n# a stop\n1,2,3\n2,3,4\n", encoding="utf-8")
    assert len(MotionLog.read(file)) == 3
    assert MotionLog.lines(file, [0, 1, 2]).tolist() == [4, 7, 8]
