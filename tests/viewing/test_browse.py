"""The page of results: what it holds of each variable, as exactly as it says, and what it says of bad input."""

import base64
import json
import re
import zlib

import numpy as np
import pytest

from gantrytau import ModelError, Result, browse

T = np.array([0.0, 0.25, 0.5, 0.5, 1.0])
VALUES = {
    "a.x": [0.0, 0.25, 0.5, -3.0, np.nan],
    "a.y": [0.0, -0.25, -0.5, 3.0, np.nan],
    "a.on": [0.0, 0.0, 0.0, 1.0, 1.0],
    "a.level": [0.0, 0.0, 0.0, 2.0, 2.0],
    "b.r[0]": [1e9, 1e9 + 1, 1e9 + 2, 1e9 + 4, 1e9 + 7],
    "b.r[1]": [1e-290, 2e-290, 3e-290, 0.0, -1e-290],
    "b.m": 2.5,
}


def run(**more):
    return Result(T, VALUES, **{"aliases": {"b.y": "-a.x"}, "units": {"a.x": "m"}, "title": "run", **more})


def unpacked(page):
    return unpacked_text(page.text)


def unpacked_text(text):
    """What a page is told, and the values of a variable in a run as it computes them, (times,)."""
    found = re.search(r'<script type="text/plain" id="data">\n(.*?)\n</script>', text, re.DOTALL)
    assert found
    head, *blocks = [zlib.decompress(base64.b64decode(line)) for line in found[1].split("\n")]
    told = json.loads(head)

    def values(name, k=0):
        variable = next(one for one in told["variables"] if one["name"] == name)
        reference, (a, b) = variable["runs"][k], variable.get("scale", (1.0, 0.0))
        if not isinstance(reference, list):
            return reference
        block, row, rows, order, least, step = told["runs"][k]["columns"][reference[0]]
        planes = (
            np.frombuffer(blocks[block], np.uint8)
            .reshape(-1, rows, told["runs"][k]["size"])[:, row]
            .astype(np.int64)
        )
        stored = (planes * 256 ** np.arange(len(planes))[:, None]).sum(axis=0)
        integers = (stored >> 1) ^ -(stored & 1)
        for _ in range(order):
            integers = np.cumsum(integers)
        integers = (integers + 2**31) % 2**32 - 2**31
        found = a * reference[1] * step * (integers + least) + b
        return np.where(integers == -1, np.nan, found)

    return told, values


def test_a_page_holds_values_as_they_are_and_equal_signals_once():
    told, values = unpacked(browse(run()))
    for name, expected in VALUES.items():
        if name == "b.m":
            assert values(name) == 2.5
        else:
            ptp = np.nanmax(expected) - np.nanmin(expected)
            np.testing.assert_allclose(values(name), expected, rtol=0, atol=2.0 ** -told["bits"] * ptp)
    np.testing.assert_array_equal(values("b.y"), values("a.y"))
    assert len(told["runs"][0]["columns"]) == 5  # of nine names, one constant, two equal or opposite
    modes = {one["name"] for one in told["variables"] if "modes" in one}
    assert modes == {"a.on"}


def test_random_signals_come_back_to_their_bits():
    random = np.random.default_rng(5)
    values = {f"x{k}": random.standard_normal(400) * 10.0 ** random.integers(-9, 9) + k for k in range(600)}
    _, found = unpacked(browse(Result(np.linspace(0, 1, 400), values)))
    for name, expected in values.items():
        np.testing.assert_allclose(found(name), expected, rtol=0, atol=2**-30 * np.ptp(expected))


def test_units_words_and_modes_are_told():
    crank = Result(
        [0.0, 1.0],
        {"phi": [0.0, np.pi], "law": [0.0, 1.0]},
        units={"phi": "rad"},
        displays={"phi": "deg"},
        descriptions={"phi": "angle"},
        modes={"law": ("stuck", "sliding")},
        held=["law"],
    )
    told, values = unpacked(browse(crank))
    phi, law = told["variables"]
    assert (phi["unit"], phi["words"], law["modes"], law["held"]) == ("deg", "angle", ["stuck", "sliding"], 1)
    np.testing.assert_allclose(values("phi"), [0.0, 180.0], atol=1e-6)
    assert unpacked(browse(crank, display="SI"))[0]["variables"][0]["unit"] == "rad"


def test_variables_are_chosen_by_name_and_by_component():
    told, _ = unpacked(browse(run(), names=["a", "b.r"], first=["b.r"]))
    assert [one["name"] for one in told["variables"]] == ["a.x", "a.y", "a.on", "a.level", "b.r[0]", "b.r[1]"]
    assert told["first"] == ["b.r[0]", "b.r[1]"]


def test_runs_with_other_variables_and_titles_lie_over_each_other():
    told, values = unpacked(browse(run(), run(), Result([0.0, 2.0], {"a.x": [1.0, 2.0]}, units={"a.x": "m"})))
    assert [one["title"] for one in told["runs"]] == ["run (1)", "run (2)", "run (3)"]
    np.testing.assert_allclose(values("a.x", 2), [1.0, 2.0])
    assert values("b.m", 2) is None


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (dict(names=["a.z"]), "a.z"),
        (dict(first=["c"]), "first"),
        (dict(names="a.x"), "names one by one"),
        (dict(titles=["one", "two"]), "one for each of 1 results"),
        (dict(display="kg"), "kg"),
    ],
)
def test_bad_arguments_are_told(arguments, words):
    with pytest.raises(ModelError, match=words):
        browse(run(), **arguments)


def test_what_is_no_result_or_too_large_is_told():
    with pytest.raises(ModelError, match="found nothing, expected results"):
        browse()
    with pytest.raises(ModelError, match="browse: found dict, expected what simulate"):
        browse({"x": [1.0]})
    with pytest.raises(ModelError, match="found no variables in run"):
        browse(Result([0.0, 1.0], {}, title="run"))
    times = np.linspace(0, 1, 60_000)
    large = Result(times, {f"x{k}": times for k in range(1000)})
    with pytest.raises(ModelError, match=r"480 MB.*at most 400 MB.*names="):
        browse(large)
    assert len(browse(large, names=["x1", "x2"]).text) < 1e6


def test_a_title_is_no_markup_and_nothing_is_fetched():
    text = browse(run(title="<b>&")).text
    assert "<title>&lt;b&gt;&amp;</title>" in text
    assert re.findall(r"<(?:script|link|img|iframe)[^>]*?(?:src|href)=", text) == []


def test_files_of_other_kinds_are_told_and_one_result_has_its_title(tmp_path):
    with pytest.raises(ModelError, match=r"x\.pdf: found the suffix of another kind of file, expected"):
        browse(run(), file=tmp_path / "x.pdf")
    with pytest.raises(ModelError, match=r"found the file fall\.nc, .*`gantrytau browse fall\.nc` shows a"):
        browse("fall.nc")
    assert "<h1>first run</h1>" in browse(run(), titles=["first run"]).text
