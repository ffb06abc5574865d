"""Instances in threads of their own: the same numbers as one after another, and nothing that they share."""

import re
import shutil

import pytest

from tests.fmu.runtime.robust_models import compiler, driver, run, unpacked

MODELS = ("parallelogram", "sledge")


@pytest.mark.parametrize("model", MODELS)
def test_eight_threads_give_the_numbers_of_one(model):
    program = driver(model, "threads")
    for version in "23":
        done = run([program, version])
        assert done.returncode == 0, done.stderr


def test_threads_do_not_race():
    try:
        program = driver("sledge", "threads", "-fsanitize=thread")
        done = run([program, "3"])
    except AssertionError:
        pytest.skip("gcc has no thread sanitizer")
    if "unexpected memory mapping" in done.stderr:
        pytest.skip("the thread sanitizer does not run on this kernel")
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("model", MODELS)
def test_a_library_has_no_data_that_change(model, tmp_path):
    """Of what may be written, an object file has nothing but addresses, which are read-only once it is loaded."""
    inspect = shutil.which("objdump")
    if inspect is None:
        pytest.skip("no objdump")
    unit, found = unpacked(model).sources / "fmu.c", tmp_path / "fmu.o"
    assert run([compiler(), "-std=c99", "-O0", "-fPIC", "-c", unit, "-o", found]).returncode == 0
    table = run([inspect, "-t", found]).stdout
    objects = re.findall(r" O (\.\S+)\t\S+ (?:\.hidden )?(\S+)", table)
    assert "gt_variables" in {name for _, name in objects}
    sections = {section for section, name in objects}
    assert sections <= {".rodata", ".data.rel.ro", ".data.rel.ro.local"}, objects
    assert "*COM*" not in table
