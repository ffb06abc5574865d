"""Tables of TOML files: keys that are unknown or missing, and values of another kind, are refused by their place."""

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau.border.schema import Value, read_table, read_toml

KEYS = {
    "tape": Value("m", above=0.0),
    "strokes": Value("m,rad", ((2,), (None, 2))),
    "ball_joint": Value("rad"),
    "poses": Value("whole", least=1),
    "kind": Value("text", words=("box", "ball")),
    "names": Value("texts"),
    "set": Value("table"),
    "event": Value("table", ((None,),)),
    "free": Value("any"),
}


def test_values_are_si():
    table = {"tape": "5 mm", "strokes": ["0 mm", 1.5], "ball_joint": "50 deg", "poses": 20, "kind": "Box"}
    table |= {"names": ["u"], "set": {"m": 1}, "event": [{"at": 0.1}], "free": "whatever"}
    found = read_table("cell.toml: ", table, KEYS, ("tape",))
    assert (found["tape"], found["strokes"], found["kind"], found["poses"]) == (0.005, [0.0, 1.5], "box", 20)
    assert found["ball_joint"] == pytest.approx(np.radians(50), rel=1e-15)
    assert found["event"] == [{"at": 0.1}]


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"tap": 1}, "cell.toml: tap: there is no such key; did you mean 'tape'?"),
        ({"tape": "5 deg"}, 'tape: found "5 deg", expected a length in m; units are m, mm, cm, um, in'),
        ({"tape": True}, "tape: found True, expected a length in m"),
        ({"tape": 0}, "tape: found 0, expected a length in m above 0"),
        ({"tape": "1.2.3 mm"}, 'found "1.2.3 mm", expected a length in m; units are'),
        ({"poses": 4.5}, "poses: found 4.5, expected a whole number"),
        ({"poses": 0}, "expected a whole number of at least 1"),
        ({"strokes": [0, 1600]}, "strokes[1]: found 1600, expected a length in m or an angle in rad"),
        ({"strokes": [0, 1, 2]}, "strokes: found [0, 1, 2], expected [., .] or [[., .], [., .], ...]"),
        ({"ball_joint": 50}, 'ball_joint: found 50, expected an angle in rad, up to 6.28; write "50 deg"'),
        ({"kind": "bax"}, "kind: found \"bax\"; did you mean 'box'?"),
        ({"kind": 3}, "kind: found 3, expected a text in quotes"),
        ({"names": "u"}, 'names: found "u", expected a list of texts in quotes'),
        ({"set": 3}, "set: found 3, expected a table"),
        ({"event": {"at": 1}}, "event: found a table, expected a table for each, [[event]]"),
    ],
)  # fmt: skip
def test_another_table_is_refused_by_its_place(table, words):
    with pytest.raises(ModelError) as refusal:
        read_table("cell.toml: ", table, KEYS)
    assert words in str(refusal.value)


def test_what_is_needed_is_asked_for():
    with pytest.raises(ModelError, match="tape: found nothing, expected a length in m"):
        read_table("cell.toml: ", {}, KEYS, ("tape",))


@pytest.mark.parametrize(
    ("text", "words"), [(None, "there is no such file"), ("a.b[0] = 1", "stand in quotes")]
)
def test_what_is_no_toml_is_refused(tmp_path, text, words):
    file = tmp_path / "cell.toml"
    if text is not None:
        file.write_text(text)
    with pytest.raises(ModelError, match=words):
        read_toml(file)
