"""Random numbers of Modelica text are those of the published generators, bit by bit, on numbers and in a running model."""

import numpy as np
import pytest

from gantrytau import load_modelica, simulate
from gantrytau.modelica.external.random_numbers import FUNCTIONS, STAR_64, STAR_1024

ALL = 2**64 - 1


def halves(words):
    """Words of 64 bits as Integers of 32 bits with their signs, the lower half first."""
    unsigned = [half for word in words for half in (word & 0xFFFFFFFF, word >> 32)]
    return [half - 2**32 if half >= 2**31 else half for half in unsigned]


def fraction(word):
    return (word - 2**64 if word >= 2**63 else word) * 2.0**-64 + 0.5


def star_64(words):
    (x,) = words
    x ^= x >> 12
    x ^= x << 25 & ALL
    x ^= x >> 27
    x = x * STAR_64 & ALL
    return [x], [], fraction(x)


def plus_128(words):
    x, y = words
    x ^= x << 23 & ALL
    new = (x ^ y ^ x >> 17 ^ y >> 26) + y & ALL
    return [words[1], new], [], fraction(new)


def star_1024(words, place=3):
    words, following = list(words), place + 1
    x, y = words[following], words[place]
    x ^= x << 31 & ALL
    words[following] = new = x ^ x >> 11 ^ y ^ y >> 30
    return words, [following], fraction(new * STAR_1024 & ALL)


@pytest.mark.parametrize(
    ("name", "direct", "count"),
    [("64star", star_64, 1), ("128plus", plus_128, 2), ("1024star", star_1024, 16)],
)
def test_generators_are_those_of_integers(name, direct, count):
    rng = np.random.default_rng(count)
    for _ in range(5):
        words = [int(one) for one in rng.integers(0, ALL, count, dtype=np.uint64, endpoint=True)]
        given = np.array([*halves(words), *([3] if count == 16 else [])], dtype=object)
        state, value = FUNCTIONS[f"ModelicaRandom_xorshift{name}"](given)
        wanted, place, number = direct(words)
        assert [*state] == [*halves(wanted), *place]
        assert value == pytest.approx(number, abs=1e-15)


DRAWN = """function draw
  input Integer before[4];
  output Real r;
  output Integer after[4];
  external "C" ModelicaRandom_xorshift128plus(before, after, r);
end draw;
model M
  parameter Integer seed(fixed=false);
  parameter Integer given = 7;
  parameter Real first(fixed=false);
  parameter Real doubled = 2 * first;
  discrete Real r;
  Integer state[4];
initial equation
  seed = 2 * given;
  first = time + 3;
  pre(state) = {seed, 1, 2, 3};
  r = draw(pre(state));
equation
  when sample(0, 1) then
    (r, state) = draw(pre(state));
  end when;
end M;
"""


def test_a_sample_at_the_start_draws_the_first_number_and_each_sample_one_more(tmp_path):
    (tmp_path / "m.mo").write_text(DRAWN)
    found = simulate(load_modelica(tmp_path / "m.mo")["M"](), stop=2.5)
    words, drawn = [14 + 2**32, 2 + 3 * 2**32], []
    for _ in range(3):
        words, _, number = plus_128(words)
        drawn.append(number)
    np.testing.assert_allclose(found.at(np.array([0.5, 1.5, 2.4]), "r"), drawn, rtol=0, atol=1e-15)
    assert (found.final("seed"), found.final("doubled")) == (14, 6)
