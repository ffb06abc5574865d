"""A finding says its rows, or the lines of a file in which they stand."""

import numpy as np
import pytest

from gantrytau_optimica import CalibrationError
from gantrytau_optimica.fitting.finding import Finding, Rows

LINES = np.array([2, 3, 5, 6, 7, 9, 10, 11, 12, 13])  # of ten rows: comments stand between


@pytest.mark.parametrize(
    ("rows", "of", "said", "in_lines"),
    [
        ([1], None, "row 1", "line 3"),
        ([2, 5], None, "rows 2 and 5", "lines 5 and 9"),
        ([2, 3, 4, 5], None, "rows 2 to 5", "lines 5 to 7 and 9"),
        ([0, 1, 2, 4, 5, 6, 7, 8, 9], 10, "all but row 3", "all but line 6"),
    ],
)
def test_rows_are_said_as_lines_of_a_file(rows, of, said, in_lines):
    finding = Finding("jump", np.array(rows), (Rows(rows, of), " are off"))
    assert finding.message == f"{said} are off"
    assert finding.in_lines(LINES).message == f"{in_lines} are off"
    error = CalibrationError("found ", Rows(rows, of), rows=rows, place="Measurements")
    assert str(error) == f"Measurements: found {said}"
    assert error.in_lines(LINES).words(str) == f"found {in_lines}"


def test_a_few_rows_that_a_sentence_does_not_name_stand_at_its_end():
    assert Finding("far", np.array([1]), "q2 is far").in_lines(LINES).message == "q2 is far (line 3)"
    assert Finding("far", np.arange(9), "q2 is far").in_lines(LINES).message == "q2 is far"
