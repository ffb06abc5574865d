"""What a study refuses, and in which words."""

from typing import Any

import pytest

from gantrytau import ModelError, study
from gantrytau_models import Pendulum

WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "unknown name": (dict(over={"mm": [1.0]}), r"Pendulum has no parameter, variable or input 'mm'; did you mean 'm'"),
    "start in words": (dict(over={"x.start": [1.0]}), r"'x\.start'; write 'x', which varies its start value"),
    "no values": (dict(over={"m": []}), r"over: m: found no values, expected at least one; leave the name out"),
    "one value": (dict(over={"m": 2.0}), r"over: m: found 2, expected a list of values; for one value write \[value\]"),
    "a word": (dict(over={"m": "12"}), r"over: m: found '12', expected a list of values"),
    "nothing": (dict(over={}), r"found nothing that varies, expected over=\{name: values\} or seeds="),
    "no mapping": (dict(over=["m"]), r"found over=\['m'\], expected \{name: values\}"),
    "lengths": (
        dict(over={"m": [1, 2], "L": [1, 2, 3]}, combine="zip"),
        r"m has 2, L has 3; expected as many values of each, as combine='zip' takes them one by one",
    ),
    "way": (dict(over={"m": [1]}, combine="gird"), r"found combine='gird', expected 'grid' or 'zip'; did you mean 'grid'"),
    "seeds": (dict(seeds=0), r"found seeds=0, expected a whole number of at least 1"),
    "half a seed": (dict(seeds=[1, 0.5]), r"found seeds=0\.5, expected a whole number of at least 0"),
    "seeds twice": (dict(seeds=[1, 1]), r"found seeds=\[1, 1\], expected how many, as 20, or a list of different"),
    "seed as a name": (dict(over={"seed": [1]}), r"over: found 'seed', expected it as seeds=\[\.\.\.\]"),
    "where": (dict(over={"m": [1]}, where="proceses"), r"found where='proceses'.*did you mean 'processes'"),
    "shape": (dict(over={"m": [1.0, [1.0, 2.0]]}), r"m: found 2 values, expected 1"),
    "output": (dict(over={"m": [1.0]}, outputs=["tensoin"]), r"'tensoin'; did you mean 'tension'"),
    "keyword": (dict(over={"m": [1.0]}, tolerence=1e-6), r"there is no keyword 'tolerence'; did you mean 'tolerance'"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_wrong_input_is_told_before_anything_runs(case):
    keywords, words = WRONG[case]
    with pytest.raises(ModelError, match=words):
        study(Pendulum(), stop=1.0, **keywords)


def test_a_model_needs_its_end():
    with pytest.raises(ModelError, match=r"study: found no stop="):
        study(Pendulum(), over={"m": [1.0]})


def test_functions_are_checked_against_their_arguments():
    def area(width, height):
        return width * height

    with pytest.raises(ModelError, match=r"area has no argument 'widht'; did you mean 'width'\?"):
        study(area, over={"widht": [1], "height": [1]})
    with pytest.raises(ModelError, match=r"area needs height, expected values by over=; or give a default"):
        study(area, over={"width": [1]})
    with pytest.raises(ModelError, match=r"area has no argument 'seed'"):
        study(area, over={"width": [1], "height": [1]}, seeds=2)
    with pytest.raises(ModelError, match=r"found stop=1\.0 with the function area"):
        study(area, over={"width": [1], "height": [1]}, stop=1.0)
    with pytest.raises(ModelError, match=r"found <class .*Pendulum.*>, expected a model, as Pendulum\(\)"):
        study(Pendulum, over={"m": [1]}, stop=1.0)
