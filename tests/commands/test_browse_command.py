"""`gantrytau browse`: pages of saved results, and what is said of files that cannot be shown."""

import pytest

from gantrytau import Result
from gantrytau.commands.arguments.saved_results import FORMATS, read_result
from tests.viewing.test_browse import unpacked_text

MISUSE = 2


@pytest.fixture
def saved(tmp_path):
    """A result in each format, with a vector, units, descriptions and a mode."""
    run = Result(
        [0.0, 1.0, 1.0, 2.0],
        {"a.r[0]": [0.0, 1.0, 2.0, 3.0], "a.r[1]": 2.0, "a.law": [0, 0, 1, 1], "b.phi": [0.0, 1.0, 1.0, 0.5]},
        units={"a.r": "m", "b.phi": "rad"},
        descriptions={"a.r": "place", "a.law": "law: 0 stuck, 1 sliding"},
        title="run",
    )
    return {suffix: run.save(tmp_path / f"run{suffix}") for suffix in FORMATS}


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_saved_result_becomes_a_page_with_what_its_file_says(run, saved, tmp_path, suffix):
    said = run("browse", saved[suffix], "--first", "b.phi")
    page = tmp_path / "run.html"
    assert (said.exit_code, said.stdout) == (0, f"Written: {page}\n")
    told, values = unpacked_text(page.read_text(encoding="utf-8"))
    found = {one["name"]: one for one in told["variables"]}
    assert set(found) == {"a.r[0]", "a.r[1]", "a.law", "b.phi"}
    assert found["a.r[0]"]["unit"] == "m"
    assert told["first"] == ["b.phi"]
    assert values("a.r[0]") == pytest.approx([0, 1, 2, 3])
    if suffix != ".csv":  # which has no room for descriptions
        assert found["a.r[0]"]["words"] == "place"
        assert found["a.law"]["modes"] == ["stuck", "sliding"]


def test_runs_are_drawn_over_each_other_with_the_variables_that_are_named(answer, saved, tmp_path):
    page = tmp_path / "both.html"
    told = answer("browse", saved[".nc"], saved[".parquet"], "--names", "a", "-o", page)
    assert (told["variables"], told["bytes"]) == (3, page.stat().st_size)
    assert "b.phi" not in read_result(saved[".nc"], wanted=["a"])


def test_a_model_moves_beside(run, tmp_path):
    motion, page = tmp_path / "motion.nc", tmp_path / "page.html"
    assert run("simulate", "Pendulum", "--stop", 0.1, "--points", 5, "--output", motion).exit_code == 0
    assert run("browse", motion, "--model", "Pendulum", "-o", page).exit_code == 0
    assert '"mantine' in page.read_text(encoding="utf-8") or page.stat().st_size > 5e5


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("none.nc", None, "there is no such file"),
        ("run.txt", "1 2 3", "found the suffix '.txt', expected a result saved as .csv, .nc, .parquet or"),
        ("run.nc", "no netCDF", "cannot be read as a result"),
        ("run.csv", "x,y\n1,2\n2,3\n", "found no 'time'"),
    ],
)
def test_files_that_are_no_results_are_told(fails, tmp_path, name, content, words):
    file = tmp_path / name
    if content is not None:
        file.write_text(content)
    said = fails(MISUSE, "browse", file, "-o", tmp_path / "page.html")
    assert said.startswith(f"RESULT {file}: ")
    assert words in said
    assert not (tmp_path / "page.html").exists()


def test_unknown_names_are_told_as_the_option(fails, saved, tmp_path):
    assert "--names" in fails(MISUSE, "browse", saved[".nc"], "--names", "c", "-o", tmp_path / "page.html")
    assert "--first" in fails(MISUSE, "browse", saved[".nc"], "--first", "c", "-o", tmp_path / "page.html")


@pytest.mark.parametrize("suffix", FORMATS)
def test_what_is_too_large_is_told_before_it_is_read(saved, suffix):
    with pytest.raises(Exception, match=r"found .* MB of numbers, expected at most 0 MB; "):
        read_result(saved[suffix], "RESULT", most=3)
