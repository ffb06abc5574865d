"""Files, sensors and hands as clients of a controller."""

from typing import Any

import numpy as np
import pytest

from gantrytau import ModelError, Result, Samples
from gantrytau_fmu.controller import Channel, Controller, Declaration, Sample
from gantrytau_fmu.controller.board import ACTIVATE
from gantrytau_fmu.controller.exchange import FunctionClient, haptic_client, stream_file, stream_sensor
from tests.fmu.controller.conftest import slide

PERIOD = 0.004
N = 40


def follow(name):
    return lambda t, values: {"q_ref": values[name]}


def run(client, name, **settings):
    controller = Controller(slide(), follow(name), clients=[client], **settings)
    controller.set("f_activate", 1.0, at=10 * PERIOD)
    controller.set("f_activate", 0.0, at=30 * PERIOD)
    return controller.run(N * PERIOD)


def corrections(file, rows=8, step=PERIOD):
    """A file as learning control writes its corrections."""
    t = step * np.arange(rows)
    Result(t, {"dq": 0.01 * (1 + np.arange(rows))}, units={"dq": "m"}, title="corrections").save(file)
    return file


def test_a_file_is_sent_a_row_a_sample_while_it_is_activated(tmp_path):
    stream = stream_file(corrections(tmp_path / "u.csv"))
    assert (stream.sends.names, stream.sends["dq"].unit) == (("dq",), "m")
    assert stream.state == "waits for f_activate"
    sent = run(stream, "stream.dq")["stream.dq"]
    # active in sample 10, which is answered in 11
    assert np.allclose(sent[11:19], 0.01 * (1 + np.arange(8)), rtol=1e-14)
    assert np.all(sent[19:31] == sent[18])
    assert not sent[:11].any()
    assert not sent[31:].any()


def test_a_file_may_stop_at_its_end_and_is_read_anew(tmp_path):
    file = corrections(tmp_path / "u.csv")
    stream = stream_file(file, at_end="stop")
    controller = Controller(slide(), follow("stream.dq"), clients=[stream])
    for at, value in ((0.0, 1.0), (20 * PERIOD, 0.0), (25 * PERIOD, 1.0)):
        controller.set("f_activate", value, at=at)
    found = controller.run(30 * PERIOD)
    assert found.timing.clients["stream"].held >= 10
    assert np.allclose(found["stream.dq"][26:31], 0.01 * (1 + np.arange(5)))
    assert stream.state == "row 6 of 8"


def test_where_a_stream_ends_is_said(tmp_path):
    ends: Any = {"hold": "holds the last", "stop": "stops"}
    for at_end, words in ends.items():
        stream = stream_file(corrections(tmp_path / "u.csv"), at_end=at_end)
        controller = Controller(slide(), follow("stream.dq"), clients=[stream], references={"q_ref": 0.0})
        controller.set("f_activate", 1.0)
        controller.run(N * PERIOD)
        assert stream.state == f"at the end of 8 rows: {words}"


def test_rows_of_another_period_are_refused_and_the_robot_goes_on(tmp_path):
    stream = stream_file(corrections(tmp_path / "u.csv", step=0.001))
    found = run(stream, "stream.dq")
    failure = found.timing.clients["stream"].failure
    assert "found rows 0.001 s apart for samples every 0.004 s, expected one for each sample" in failure
    assert found.timing.samples == N + 1


@pytest.mark.parametrize("row", [2, 4, 7])
def test_a_row_that_is_missing_is_told_and_not_sent_too_early(tmp_path, row):
    whole = corrections(tmp_path / "u.csv")
    lines = whole.read_text().splitlines()
    whole.write_text("\n".join([*lines[: row + 1], *lines[row + 2 :]]) + "\n")
    failure = run(stream_file(whole), "stream.dq").timing.clients["stream"].failure
    if row == 7:  # the last one: nothing comes behind it
        assert not failure
    else:
        assert (
            f"found row {row + 1} at {(row + 1) * PERIOD:g} s, expected it at {row * PERIOD:g} s" in failure
        )


def test_a_sample_that_is_lost_on_its_way_shifts_no_row(tmp_path):
    stream = stream_file(corrections(tmp_path / "u.csv"))
    published = Declaration([ACTIVATE])
    rows = {}
    for k in (5, 6, 9, 10, 40):
        stream.submit(Sample(k, k * 4_000_000, np.ones(1)), published)
        answer = stream.answer(k + 1)
        assert answer is not None
        rows[k] = answer.values[0]
    table = np.array([float(line.split(",")[1]) for line in stream.path.read_text().splitlines()[1:]])
    assert [rows[k] for k in (5, 6, 9, 10)] == table[[0, 1, 4, 5]].tolist()
    assert rows[40] == table[-1]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("dq [m],time [s]\n1,2\n", "found 'time' as column 2, expected the time as the first one"),
        ("time [s],dq [m]\n", "found 1 lines, expected a header"),
        ("0.0,0.1\n0.004,0.2\n", "found numbers in the first line, expected the names"),
        ("time [s]\n0.0\n", "found no column beside the time"),
        ("time [s],dq [mm]\n0.0,1\n", "not a coherent SI unit"),
        ("dq,dq\n1,2\n", "found 2 columns 'dq'"),
        ("time [s],dq [m]\n0.0,nan\n", "line 2, column dq: found 'nan', expected a number"),
    ],
)
def test_files_that_are_no_corrections_are_refused_at_once(tmp_path, text, words):
    file = tmp_path / "u.csv"
    file.write_text(text)
    with pytest.raises(ModelError, match=words):
        stream_file(file)


def test_a_file_that_is_gone_and_other_wishes_are_told(tmp_path):
    with pytest.raises(ModelError, match="found no file to read"):
        stream_file(tmp_path / "none.csv")
    wrong: Any = "repeat"
    with pytest.raises(ModelError, match="found at_end='repeat', expected 'hold' or 'stop'"):
        stream_file(corrections(tmp_path / "u.csv"), at_end=wrong)


@pytest.mark.parametrize("kind", ["constant", "linear"])
def test_a_sensor_sends_what_it_reads_at_the_sample(kind):
    t, z = np.array([0.0, 0.0801, 0.1201]), np.array([1.0, 2.0, 3.0])
    found = run(stream_sensor(Samples(t, z, kind=kind)), "sensor.length")
    at = PERIOD * np.arange(N)
    expected = z[np.searchsorted(t, at, side="right") - 1] if kind == "constant" else np.interp(at, t, z)
    assert np.allclose(found["sensor.length"][1:], expected)


def test_a_sensor_may_be_a_function_of_time():
    found = run(stream_sensor(lambda t: 2 * t, name="gauge", channel=Channel("z", "m")), "gauge.z")
    assert np.allclose(found["gauge.z"][1:], 2 * PERIOD * np.arange(N))


def test_a_hand_feels_and_pushes():
    """A hand that gives way like a spring of 2 N for a unit: what it feels goes there and back in one sample."""
    hand = haptic_client(lambda t, felt: 0.5 - 2.0 * felt, feels="q", size=1)
    found = run(hand, "haptic.f")
    assert np.allclose(found["haptic.f"][1:], 0.5 - 2.0 * found["q"][:-1], rtol=1e-14)
    blind = haptic_client(lambda t, felt: felt, feels="f_t", size=1)
    failure = run(blind, "haptic.f").timing.clients["haptic"].failure
    assert "found no 'f_t' among what the controller publishes" in failure


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (None, "expected values by name"),
        ({"x": 1.0}, "there is no channel 'x'"),
        ({"f": "much"}, "expected one number"),
    ],
)
def test_functions_that_answer_nonsense_stand_alone(answer, words):
    client = FunctionClient("odd", [Channel("f", "N")], lambda t, values: answer)
    found = Controller(slide(), follow("odd.f"), clients=[client]).run(N * PERIOD)
    assert words in found.timing.clients["odd"].failure


def test_what_is_no_function_is_refused():
    seven: Any = 7
    with pytest.raises(ModelError, match="expected a function of t and values"):
        FunctionClient("odd", [Channel("f", "N")], seven)
    with pytest.raises(ModelError, match="expected a function of time, or Samples"):
        stream_sensor(seven)
    with pytest.raises(ModelError, match="expected one number at each time"):
        stream_sensor(Samples([0.0, 1.0], [[1.0, 2.0], [3.0, 4.0]]))
