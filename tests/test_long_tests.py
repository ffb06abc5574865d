"""The list of long tests, which `make test` leaves to `make test-all`."""

from pathlib import Path

from tests.conftest import LONG_TESTS


def test_each_line_names_a_test_that_is_there():
    gone = [
        line
        for line in LONG_TESTS.read_text().split()
        if not (file := Path(LONG_TESTS.parent, line.partition("::")[0])).exists()
        or f"def {line.partition('::')[2]}(" not in file.read_text()
    ]
    assert gone == [], "write the list anew: pytest --renew-long-tests"
