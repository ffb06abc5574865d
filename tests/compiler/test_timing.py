"""Where the time of a translation goes."""

from gantrytau import check, translate
from gantrytau_models import Pendulum


def test_check_tells_the_stages_in_their_order():
    timing = check(Pendulum()).timing
    assert list(timing)[:3] == ["instantiation", "flattening", "units"]
    assert list(timing)[-1] == "determinacy"
    assert all(seconds >= 0 for seconds in timing.values())


def test_stages_are_printed_where_the_environment_asks(monkeypatch, capsys):
    translate(Pendulum())
    assert not capsys.readouterr().err
    monkeypatch.setenv("GANTRYTAU_TIMING", "1")
    translate(Pendulum())
    words = capsys.readouterr().err
    seconds = [float(part.split()[-1]) for part in words.partition("(")[2].rstrip(")\n").split(", ")]
    assert sum(seconds) <= float(words.split()[1]) + 0.0005 * len(seconds) + 0.0005  # each is rounded to 1 ms
