import tomllib

import pytest

from notebooks.site.builder.generated.classics_page import classics_page
from tests.classics import chemistry, initial_values
from tests.classics.families import FAMILIES
from tests.classics.lines import lines_of
from tests.classics.summary import KEPT, write_families


def test_lines_are_those_of_a_model_and_of_what_it_uses():
    assert lines_of(chemistry.StiffVanDerPol) == 5  # its class, variables, and three of equations


def test_a_problem_has_its_digits_and_those_of_its_peers():
    (hires,) = [one for one in initial_values.PROBLEMS if one.name == "Hires"]
    row = initial_values.run(hires)
    assert row["held"]
    assert "s" in str(row["radau"])


def test_what_was_not_run_stays(tmp_path):
    kept = tmp_path / "kept.toml"
    write_families({"one": {"A": {"held": True, "steps": 3}}}, kept)
    write_families({"one": {"B": {"held": False, "failure": 'a "word"'}}}, kept)
    found = tomllib.loads(kept.read_text())["one"]
    assert (found["A"]["steps"], found["B"]["failure"]) == (3, 'a "word"')


@pytest.mark.parametrize("family", FAMILIES)
def test_each_problem_has_its_line_on_the_page(family):
    kept = tomllib.loads(KEPT.read_text())[family]
    assert set(kept) == {one.name for one in FAMILIES[family][0]}
    page = classics_page()
    assert all(f"`{name}`" in page for name in kept)
