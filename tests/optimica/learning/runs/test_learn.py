"""Learning on a plant that is known exactly: what lifted systems foretell is what runs do."""

import re
from typing import Any, cast

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_optimica import (
    Complementary,
    Gradient,
    History,
    Kinematic,
    Learning,
    Measured,
    NormOptimal,
    Tukey,
    ZeroPhase,
    learn,
)
from gantrytau_optimica.learning import Actuators, LearningError, Reference, estimated_response
from gantrytau_optimica.learning.laws.lifted import lifted
from tests.optimica.learning.runs.linear_plant import (
    DELAY,
    KINEMATICS,
    PERIOD,
    RESPONSE,
    SERVOS,
    LinearPlant,
    line,
    servo,
)

WINDOW = Tukey(0.2, lead=0.2)


def test_runs_are_what_the_lifted_system_foretells():
    """e_k = (I - T) r - T u_k and u_k+1 = W Q (u_k + L e_k), by matrices and by runs, to 1e-10 of the motion."""
    reference = line()
    history = learn(LinearPlant(), reference, Learning(window=WINDOW), iterations=4, response=RESPONSE)
    learning, T = Learning(window=WINDOW), lifted(RESPONSE, len(reference))
    q_r = KINEMATICS.ik(reference.r)
    moved = (q_r - q_r[0]).T.ravel()
    u = np.zeros_like(moved)
    for k in range(5):
        e = moved - T @ (moved + u)
        assert np.abs(history.inputs[k].T.ravel() - u).max() < 1e-10 * np.ptp(q_r)
        assert np.abs(history.error(k).T.ravel() - e).max() < 1e-10 * np.ptp(q_r)
        shaped = [x.reshape(3, -1).T for x in (u, e)]
        u = learning.next(*shaped, PERIOD).T.ravel()
    assert np.all(history.relative[4] < 40)
    assert history.tool_relative[4, 0] < 40
    assert np.all(np.isnan(history.tool_relative[:, 1:]))  # axes in which the reference rests
    assert history.corrected == pytest.approx(history.input, abs=1e-15)


@pytest.mark.parametrize("law", [Gradient(), NormOptimal(weight=1e-3)])
def test_laws_by_a_model_learn_with_the_response_that_is_measured(law):
    learning = Learning(law=law, window=WINDOW, q=ZeroPhase.butterworth(2, 60.0))
    history = learn(LinearPlant(), line(), learning, iterations=8, response=RESPONSE)
    assert history.stability is not None
    assert history.stability.stable
    assert np.all(np.diff(history.relative, axis=0)[:3] < 0)
    assert np.all(history.relative[-1] < (60 if isinstance(law, Gradient) else 5))


def test_a_response_is_measured_where_none_is_given():
    """Delay and answer of (6.11), and of a tool that swings at 9 Hz, in noise of a micrometre."""
    found = estimated_response(LinearPlant(noise=1e-6), line(), Actuators())
    assert re.fullmatch(
        r"<EstimatedResponse: system of order \d+, every 0.004 s, \d samples late, fits 9.*, 9.*, 9.* %>",
        repr(found),
    )
    assert found.delay == DELAY
    hz = np.array([0.5, 2.0, 5.0, 10.0])
    exact = np.column_stack([each.response(hz)[0, 0] for each in RESPONSE])
    assert np.diagonal(found.response(hz)) == pytest.approx(exact, abs=0.02)
    off = found.response(hz) * (1 - np.eye(3))[:, :, None]
    assert np.abs(off).max() < 0.02
    swinging = estimated_response(LinearPlant(1e-6, swing=(9.0, 0.05)), line(), Measured())
    assert swinging.axes == 1
    assert np.min(np.abs(swinging.system.eigenfrequencies - 9.0)) < 0.05
    still, moved = np.tile(line().r[0], (501, 1)), np.tile(line().r[0], (501, 1))
    moved[1, 0] += 1e-6  # small, so that the kinematics are straight
    rows = [
        np.asarray(LinearPlant(swing=(9.0, 0.05)).run(KINEMATICS.ik(r), np.zeros((501, 3)))["measured.r"])
        for r in (moved, still)
    ]
    pulse = (rows[0] - rows[1])[1:, 0] / 1e-6
    assert swinging.lifted(500)[:, 0] == pytest.approx(pulse, abs=0.05 * np.abs(pulse).max())


def test_what_would_diverge_is_refused_and_runs_by_force():
    """A swing at 7 Hz turns the phase of what is learnt above it: errors fall at first, and grow then, as foretold."""
    plant, learning = LinearPlant(swing=(7.0, 0.02)), Learning(window=WINDOW)
    with pytest.raises(LearningError, match=r"sigma 2.*diverges: after 10 runs up to .*force=True") as told:
        learn(plant, line(), learning, Measured(), iterations=6)
    assert told.value.history is None
    forced = learn(plant, line(), learning, Measured(), iterations=14, force=True)
    assert forced.relative[-1, 0] > 2 * forced.relative[:10, 0].min()
    low = Learning(window=WINDOW, q=ZeroPhase.butterworth(2, 3.0))
    assert learn(plant, line(), low, Measured(), iterations=14).relative[-1, 0] < 20


@pytest.mark.parametrize("differs", [dict(late=25), dict(limit=2e-3), dict(noise=5e-3)], ids=str)
def test_a_plant_that_answers_otherwise_than_foretold_is_told(differs):
    """A delay, a limit, and runs that do not repeat, beside the response of (6.11); its own plant is told of nothing."""
    asked: dict[str, Any] = dict(iterations=6, response=RESPONSE)
    history = learn(LinearPlant(**differs), line(), Learning(window=WINDOW), **asked)
    (finding,) = history.findings
    assert finding.kind == "foretold"
    assert "otherwise than the response foretells" in str(history)
    assert learn(LinearPlant(1e-5), line(), Learning(window=WINDOW), **asked).findings == ()


def test_a_run_of_another_length_is_told():
    with pytest.raises(LearningError, match=r"LinearPlant\.run: found 397 rows, expected 400"):
        learn(LinearPlant(lost=3), line(), Learning(window=WINDOW), response=RESPONSE)
    with pytest.raises(ModelError, match=r"LinearPlant\.run: found 6097 rows, expected 6100"):
        estimated_response(LinearPlant(lost=3), line(), Actuators())


def test_a_history_goes_on_under_another_law_and_is_judged_where_both_apply():
    asked: dict[str, Any] = dict(response=RESPONSE)
    first = learn(LinearPlant(), line(), Learning(window=WINDOW), iterations=2, **asked)
    narrow = Learning(window=Tukey(0.4, lead=0.2), gain=0.5)
    found = learn(LinearPlant(), line(), narrow, iterations=5, history=first, **asked)
    assert found.settings["learning"] == repr(narrow)
    assert found.settings["since"] == 3
    assert np.array_equal(found.full, first.full & narrow.window.full(400, PERIOD))
    assert found.findings == ()
    with pytest.raises(ModelError, match="nowhere applies in full where that of the history does"):
        learn(
            LinearPlant(),
            line(),
            Learning(window=Tukey(1.35, lead=0.1)),
            history=first,
            iterations=3,
            **asked,
        )


def test_histories_on_file_go_on_where_they_ended(tmp_path):
    file = tmp_path / "history.npz"
    asked: dict[str, Any] = dict(response=RESPONSE, seed=2)
    whole = learn(LinearPlant(1e-5), line(), Learning(window=WINDOW), iterations=4, **asked)
    learn(LinearPlant(1e-5), line(), Learning(window=WINDOW), iterations=1, history=file, **asked)
    found = learn(LinearPlant(1e-5), line(), Learning(window=WINDOW), iterations=4, history=file, **asked)
    assert np.array_equal(found.relative, whole.relative)
    read = History.load(file)
    assert len(read) == 5
    assert np.array_equal(read.next_input, whole.next_input)
    assert str(read).splitlines()[1:] == str(whole).splitlines()[2:]  # all but what is foretold
    again = LinearPlant()
    assert len(learn(again, line(), Learning(window=WINDOW), iterations=4, history=read, **asked)) == 5
    assert again.runs == 0  # nothing was left to do


def test_an_interrupt_loses_no_finished_run(tmp_path):
    file = tmp_path / "history.npz"
    with pytest.raises(LearningError, match=r"run 3 was interrupted, the 3 before it stand in") as told:
        learn(LinearPlant(fails=3), line(), Learning(window=WINDOW), response=RESPONSE, history=file)
    assert told.value.history is not None
    assert len(told.value.history) == 3
    assert len(History.load(file)) == 3


def test_a_run_that_fails_is_told_with_those_before_it():
    """The second correction takes the robot out of reach."""
    reference = line(length=0.5)
    wild = Learning(gain=-60.0, window=WINDOW)
    with pytest.raises(LearningError, match=r"run \d failed, the \d before it stand in .history") as told:
        learn(
            LinearPlant(), reference, wild, Measured(), response=servo(*SERVOS[0]), force=True, iterations=9
        )
    assert told.value.history is not None
    assert len(told.value.history) >= 1


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (dict(reference=Reference(0.001 * np.arange(400), line().r)), "reference every 0.001 s, expected"),
        (dict(learning=Learning(window=Tukey(0.0, 9.0))), "window from 0 to 9 s, expected one within the"),
        (dict(response=[servo(*each, period=0.002) for each in SERVOS]), "sampled every 0.002 s, expected"),
        (dict(response=RESPONSE[:2]), "response of 2 corrections, expected 3"),
        (dict(estimator=Complementary(), response=None), "measured.q, measured.r, expected measured.a"),
        (
            dict(reference=Reference(PERIOD * np.arange(400), np.tile(line().r[0], (400, 1)))),
            "reference that rests",
        ),
        (dict(history="runs.txt"), "suffix '.txt', expected .npz"),
        (dict(estimator=Measured), "found estimator=.*, expected one such as Actuators"),
        (dict(learning=Learning(window=Tukey(0.4, 0.8, lead=0.2, alpha=1.0))), "a window whose flanks meet"),
        (dict(response="none"), "the response 'none', expected a sampled linear system"),
    ],
)
def test_what_does_not_fit_is_told_by_name(wrong, words):
    asked: dict[str, Any] = (
        dict(reference=line(), learning=Learning(window=WINDOW), response=RESPONSE, iterations=1) | wrong
    )
    reference = asked.pop("reference")
    with pytest.raises(ModelError, match=words):
        learn(LinearPlant(), reference, asked.pop("learning"), asked.pop("estimator", None), **asked)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda: learn(cast(Any, None), line()), "None without run, period, kinematics, expected a Rig"),
        (lambda: Learning(law=cast(Any, "gradient")), "law='gradient', expected one such as Gradient"),
        (lambda: Learning(q=cast(Any, 10.0)), r"q=10.0, expected one such as ZeroPhase.butterworth"),
        (lambda: Learning(window=cast(Any, None)), "window=None, expected one such as Tukey"),
        (lambda: Reference([0.0, 0.004], np.zeros((2, 3))), "found 2 rows of t, expected 3 at least"),
        (lambda: learn(LinearPlant(noise=1e-3), line(), Learning(window=WINDOW)), r"follows corrections"),
    ],
)
def test_things_of_another_kind_are_told_by_name(wrong, words):
    with pytest.raises(ModelError, match=words):
        wrong()


def test_another_reference_or_estimator_cannot_go_on_with_a_history():
    asked: dict[str, Any] = dict(response=RESPONSE, iterations=1)
    first = learn(LinearPlant(), line(), Learning(window=WINDOW), **asked)
    with pytest.raises(ModelError, match="not the one of the history, expected the same"):
        learn(LinearPlant(), line(length=0.011), Learning(window=WINDOW), history=first, **asked)
    with pytest.raises(ModelError, match=r"history of carts\[0\].s.* and an estimator of x"):
        learn(LinearPlant(), line(), Learning(window=WINDOW), Kinematic(), history=first, iterations=1)


def test_files_that_are_no_history_are_refused(tmp_path):
    other = tmp_path / "other.npz"
    np.savez(other, a=np.zeros(3))
    with pytest.raises(ModelError, match="no history of learning"):
        History.load(other)
    other.write_text("nothing")
    with pytest.raises(ModelError, match="no history of learning"):
        History.load(other)
    whole = (
        learn(LinearPlant(), line(), Learning(window=WINDOW), response=RESPONSE, iterations=1)
        .save(other)
        .read_bytes()
    )
    for damaged in (
        whole[: len(whole) // 2],
        whole[:-40] + bytes(40),
        whole[:2000] + b"\1\2\3\4" + whole[2004:],
    ):
        other.write_bytes(damaged)
        with pytest.raises(ModelError, match="no history of learning"):
            History.load(other)
    with pytest.raises(ModelError, match="no such file"):
        History.load(tmp_path / "none.npz")


def test_pictures_and_corrections_of_a_history(tmp_path):
    history = learn(LinearPlant(), line(), Learning(window=WINDOW), response=RESPONSE, iterations=2)
    for what, axes in (("errors", 1), ("error", 3), ("input", 3), ("tool", 1), ("path", 1)):
        assert len(history.plot(what).axes) == axes
    with pytest.raises(ModelError, match=r"found what='eror', .*did you mean"):
        history.plot("eror")
    text = history.save_corrections(tmp_path / "corrections.csv").read_text().splitlines()
    assert text[0] == "time [s],carts[0].s [m],carts[1].s [m],carts[2].s [m]"
    rows = np.array([[float(x) for x in line.split(",")] for line in text[1:]])
    assert np.array_equal(rows[:, 1:], history.corrected)


def test_runs_become_tables_of_others():
    history = learn(LinearPlant(), line(), Learning(window=WINDOW), response=RESPONSE, iterations=2)
    errors = history.to_pandas()
    assert list(errors.columns) == [*history.names, "tool x"]
    np.testing.assert_array_equal(errors[history.names[0]], history.relative[:, 0])
    runs = history.to_xarray()
    assert dict(runs.sizes) == {
        "run": 3,
        "time": len(history.reference),
        "correction": 3,
        "joint": 3,
        "axis": 3,
    }
    np.testing.assert_array_equal(runs["q"].sel(run=1, joint=history.joints[2]), history.q[1, :, 2])
    assert runs["tool"].attrs["units"] == "m"
    assert len(history._repr_html_()) < 4000
