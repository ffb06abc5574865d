"""Targets that are missed are told, whatever kind of number the figure is."""

import importlib
import subprocess
import sys

import numpy as np
import pytest

from tests.benchmarks.table import at_least, at_most, print_table, shown


@pytest.mark.parametrize("number", [float, np.float64, np.float32])
def test_missed_targets_are_missed(number):
    assert at_most("time", number(2.0), 1.0).met is False
    assert at_most("time", number(1.0), 1.0).met is True
    assert at_least("speed", number(0.5), 1.0).met is False
    assert at_least("speed", number(np.nan), 1.0).met is False


def test_rows_are_printed_as_they_come_and_missed_ones_are_named(capsys):
    def rows():
        yield at_most("quick", 0.5, 1.0, "s")
        assert "quick" in capsys.readouterr().out  # printed before the next is measured
        yield at_most("slow", 2.0, 1.0, "s")
        yield shown("size", "3 kB")

    assert print_table("Benchmarks", [rows()]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert [line.split() for line in lines] == [
        ["slow", "2", "s", "<=", "1", "s", "NO"],
        ["size", "3", "kB"],
        ["Missed:", "slow"],
    ]


def test_a_table_whose_targets_are_met_says_so(capsys):
    assert print_table("Benchmarks", [[at_least("speed", 2.0, 1.0)]]) == 0
    assert "All targets are met." in capsys.readouterr().out


def test_every_part_of_the_table_can_be_imported():
    bench = importlib.import_module("tests.benchmarks.__main__")
    assert 0 < bench.LONGEST <= 20  # min


def test_peak_memory_is_that_of_the_process_alone():
    held = np.ones(40_000_000)  # 320 MB of the parent
    code = "from tests.benchmarks.table import peak_memory; print(peak_memory())"
    assert float(subprocess.check_output([sys.executable, "-c", code])) < held.nbytes / 2e9
