"""An index out of an array is told with the array as it is written."""

import re

import pytest

from gantrytau import Array, Input, Model, ModelError, Parameter, Real, translate


class Part(Model):
    r = Real(3)
    R = Real((2, 3))
    u = Input(start=0.0)

    def equations(self):
        yield self.r == 0
        yield self.R == 0


@pytest.mark.parametrize(
    ("statement", "words"),
    [
        (lambda m: m.part.r[3] == 1, "`m.part.r[3]`: 3, expected 0 to 2"),
        (lambda m: m.part.r[0] == m.part.r[-4], "`m.part.r[-4]`: an index below"),
        (lambda m: m.part.R[2, 0] == 1, "`m.part.R[2, 0]`: 2, expected 0 to 1"),
        (lambda m: m.part.R[1, 0:5] == 1, "`m.part.R[1, 0:5]`: 0:5, expected 0 to 2"),
        (lambda m: m.parts[2].u == 1, "`m.parts[2]`: an index below"),
    ],
)
def test_an_index_out_of_an_array_names_the_array(statement, words):
    class Whole(Model):
        part = Part()
        parts = Array(Part, 2)

        def equations(self):
            yield statement(self)

    array, _, index = map(re.escape, words.partition(": "))
    with pytest.raises(ModelError, match=rf"^the model \(Whole\), equation 1: {array} is out .*{index}"):
        translate(Whole())


def test_an_index_out_of_a_parameter_names_the_parameter():
    class Numbers(Model):
        p = Parameter([1.0, 2.0])
        q = Parameter(p[2])

    with pytest.raises(ModelError, match=r"^q: value is p\[2\], .*found the index 2, expected 0 to 1"):
        translate(Numbers())
