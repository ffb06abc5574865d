"""The controller from sample to sample: what acts when, states, limits, and what clients cannot do to it."""

import json
import math
from typing import Any

import numpy as np
import pytest

from gantrytau import Input, Model, ModelError, Output, SolveError, der, terminate, when
from gantrytau_fmu import Channel, PythonComponent
from gantrytau_fmu.controller import AxisLimits, Controller, Sample
from tests.fmu.controller.conftest import FOLLOWS, InProcess, corrected, slide

N = 50
STOP = 0.004 * N


def test_the_answer_to_sample_k_acts_in_the_next_one_exactly(plant):
    client = InProcess(answers=lambda k: [0.01 * k])
    found = Controller(plant, corrected, clients=[client]).run(STOP)
    k = np.arange(N + 1)
    assert np.array_equal(found["stream.delta"], 0.01 * np.maximum(k - 1, 0))
    assert np.array_equal(found["applied.q_ref"], found["stream.delta"])
    q = 0.0
    for row in range(N + 1):
        assert found["q"][row] == q
        q = q + FOLLOWS * (found["applied.q_ref"][row] - q)
    assert [sample.k for sample in client.seen] == k.tolist()
    assert [sample.time for sample in client.seen] == (4_000_000 * k).tolist()
    assert found.timing.clients["stream"].taken == N
    assert client.closed == 1


def test_a_client_sees_what_was_measured_in_its_sample(plant):
    client = InProcess()
    controller = Controller(plant, lambda t, values: {"q_ref": 1.0}, clients=[client])
    found = controller.run(STOP)
    place = controller.published.slices["q"]
    assert np.array_equal([sample.values[place][0] for sample in client.seen], found["q"])
    assert (
        client.seen[1].values[place][0] == FOLLOWS
    )  # of the first step: the plant was given the reference at once


def run_with_log(file):
    clients = [InProcess(name, lambda k, i=i: [0.1 * math.sin(0.1 * k + i)]) for i, name in enumerate("abc")]
    controller = Controller(
        slide(),
        lambda t, v: {"q_ref": v["f_activate"] * (v["a.delta"] + v["b.delta"] * v["c.delta"]) + math.sin(t)},
        clients=clients,
        limits={"q_ref": AxisLimits(speed=1.0)},
    )
    controller.set("f_activate", 1.0, at=0.1)
    controller.run(STOP, log=file)
    return file.read_bytes()


def test_two_runs_with_a_virtual_clock_have_logs_equal_in_every_bit(tmp_path):
    first, second = (run_with_log(tmp_path / name) for name in ("first.jsonl", "second.jsonl"))
    assert first == second
    lines = [json.loads(line) for line in first.splitlines()]
    kinds = [line["type"] for line in lines]
    assert kinds[0] == "declare"
    assert kinds[-1] == "end"
    assert kinds.count("sample") == N + 1
    assert [(line["k"], line["name"]) for line in lines if line["type"] == "set"] == [(25, "f_activate")]
    assert lines[-1]["clients"]["b"]["taken"] == N


def test_a_log_says_the_same_as_the_result(plant, tmp_path):
    controller = Controller(plant, corrected, clients=[InProcess(answers=lambda k: [1 / (k + 3)])])
    found = controller.run(STOP, log=tmp_path / "log.jsonl")
    lines = [json.loads(line) for line in (tmp_path / "log.jsonl").read_text().splitlines()]
    samples = [line["values"] for line in lines if line["type"] == "sample"]
    columns = [channel["name"] for channel in lines[0]["channels"]]
    for name, column in zip(columns, np.array(samples).T, strict=True):
        assert np.array_equal(found[name], column)


def test_states_and_parameters_change_at_the_sample_that_was_asked_for(plant):
    client = InProcess(answers=lambda k: [0.5])
    controller = Controller(plant, corrected, clients=[client], state="idle")
    controller.submit(at=0.04)  # sample 10
    controller.obtain(at=0.0781)  # behind 19, so sample 20
    controller.idle(at=0.16)
    controller.set("f_activate", 0.25, at=0.12)
    found = controller.run(STOP)
    state = found.mode("state")
    assert state[[9, 10, 19, 20, 39, 40]].tolist() == ["idle", "submit", "submit", "obtain", "obtain", "idle"]
    assert [sample.k for sample in client.seen] == list(range(10, 40))
    assert np.array_equal(np.flatnonzero(found["applied.q_ref"]), np.arange(20, 40))
    assert np.array_equal(np.flatnonzero(found["f_activate"] == 0.25), np.arange(30, N + 1))


def test_a_parameter_set_by_a_client_acts_at_the_next_boundary(plant):
    controller = Controller(plant, lambda t, v: {"q_ref": v["f_activate"]})

    class Operator(InProcess):
        def submit(self, sample, declaration):
            if sample.k == 7:
                controller.set("f_activate", 1.0)

    controller.attach(Operator("operator"))
    found = controller.run(STOP)
    assert np.array_equal(np.flatnonzero(found["applied.q_ref"]), np.arange(8, N + 1))


class Dies(InProcess):
    def submit(self, sample, declaration):
        if sample.k >= 10:
            raise ConnectionError("gone")
        super().submit(sample, declaration)


class Old(InProcess):
    """In sample 20 it repeats what it said to sample 5."""

    def answer(self, k):
        return self.given[5] if k == 20 else super().answer(k)


def sample(k: Any, values: Any) -> Sample:
    """Whatever its values are."""
    return Sample(k, 0, values)


class Strange(InProcess):
    """Answers that are none, of samples to come, of other shapes and kinds, and as text."""

    def answer(self, k):
        wrong = [
            "text",
            sample(k, np.array([9.0])),
            sample(k - 1, np.zeros(2)),
            sample("k", np.array([9.0])),
            sample(k - 1, [9.0]),
            sample(k - 1, np.array([1.0 + 1e-15 * 1000])),
        ]
        return wrong[k - 20] if 20 <= k < 26 else super().answer(k)


def silent(k):
    return None if 10 <= k < 20 else [0.001 * k]


def bad(value):
    return lambda k: [value] if 10 <= k < 20 else [0.001 * k]


FAULTS = [  # client, the samples whose answer is not taken, the counter that tells it, how often
    (lambda: Dies(answers=lambda k: [0.001 * k]), range(9, N), "held", N - 9),
    (lambda: InProcess(answers=silent), range(10, 20), "held", 10),
    (lambda: InProcess(answers=bad(math.nan)), range(10, 20), "refused", 10),
    (lambda: InProcess(answers=bad(math.inf)), range(10, 20), "refused", 10),
    (lambda: InProcess(answers=bad(1.0 + 1e-12)), range(10, 20), "refused", 10),
    (lambda: InProcess(answers=bad(-1e300)), range(10, 20), "refused", 10),
    (lambda: Old(answers=lambda k: [0.001 * k]), range(19, 20), "stale", 1),
    (lambda: Strange(answers=lambda k: [0.001 * k]), range(19, 25), "refused", 6),
]


@pytest.mark.parametrize(("make", "lost", "counter", "often"), FAULTS)
def test_a_client_that_fails_changes_nothing_but_the_counters(make, lost, counter, often, plant):
    client = make()
    found = Controller(plant, corrected, clients=[client, InProcess("other")]).run(STOP)
    expected, last = [0.0], 0.0
    for k in range(N):
        last = last if k in lost else 0.001 * k
        expected.append(last)
    assert np.array_equal(found["stream.delta"], expected)
    counts = found.timing.clients["stream"]
    assert getattr(counts, counter) == often
    assert counts.taken == N - len(lost)
    assert found.timing.clients["other"].taken == N
    assert bool(counts.failure) == isinstance(client, Dies)
    assert bool(counts.reason) == (counter == "refused")
    assert not counts.reason or "expected" in counts.reason
    if counts.failure:
        assert counts.failure == "raised ConnectionError: gone"


def test_a_law_that_answers_nan_leaves_the_robot_where_it_is(plant):
    law = lambda t, v: {"q_ref": math.nan if 0.1 <= t < 0.14 else 0.5}  # noqa: E731
    found = Controller(plant, law).run(STOP)
    assert set(found["applied.q_ref"]) == {0.5}
    assert found.timing.refused == 10


def test_limits_of_position_and_speed_hold_whatever_is_asked_for():
    random = np.random.default_rng(1)
    wild = random.standard_cauchy((N + 1, 2)) * 10.0 ** random.integers(-9, 10, (N + 1, 2))
    limits = {"q_ref": AxisLimits([-0.1, -1.0], [0.2, 1.0], speed=[5.0, 1.0])}
    plant = slide(Channel("q_ref", "m", 2))
    found = Controller(plant, lambda t, v: {"q_ref": wild[round(t / 0.004)]}, limits=limits).run(STOP)
    applied = found["applied.q_ref"]
    assert np.all((applied >= [-0.1, -1.0]) & (applied <= [0.2, 1.0]))
    steps = np.abs(np.diff(applied, axis=0))
    assert np.all(steps <= np.array([5.0, 1.0]) * 0.004 * (1 + 1e-12))  # rounding of the sum
    assert found.timing.limited > N / 2


def test_what_is_within_the_limits_is_not_touched(plant):
    limits = {"q_ref": AxisLimits(-1.0, 1.0, speed=0.5 / 0.004)}
    found = Controller(plant, lambda t, v: {"q_ref": 0.5 if t else 0.0}, limits=limits).run(STOP)
    assert np.array_equal(found["applied.q_ref"], 0.5 * (found.time > 0))
    assert found.timing.limited == 0


def test_a_switch_back_is_a_ramp_under_the_limit_of_speed(plant):
    controller = Controller(plant, lambda t, v: {"q_ref": 1.0}, limits={"q_ref": AxisLimits(speed=25.0)})
    controller.idle(at=0.1)
    applied = controller.run(STOP)["applied.q_ref"]
    assert applied[24] == 1.0
    assert np.allclose(applied[25:36], np.linspace(0.9, -0.1, 11).clip(0.0), atol=1e-12)  # rounding


def test_ten_thousand_samples_are_all_there(plant):
    clients = [InProcess(name) for name in "abc"]
    found = Controller(plant, lambda t, v: {}, clients=clients).run(40.0)
    assert found.time.size == 10_001
    assert found.timing.samples == 10_001
    assert found.timing.lateness.size == 0
    assert "10001 samples of 0.004 s" in str(found.timing)
    assert found.select(["q"]).timing is found.timing


class Fuzzed(InProcess):
    """Answers that are right, late, old, of samples to come, of wrong shapes and sizes, or not finite, as a seed has it."""

    def __init__(self, seed):
        super().__init__(answers=lambda k: [math.sin(0.1 * k)])
        self.random = np.random.default_rng(seed)

    def answer(self, k):
        right = super().answer(k)
        values = [np.full(1, value) for value in (math.nan, math.inf, -math.inf, 1e300, 1.0000001)]
        wrong = [
            sample(k - 1, value) for value in (*values, np.zeros(0), np.zeros(2), np.zeros((1, 1)), None)
        ]
        others = [
            None,
            right,
            right,
            self.given[int(self.random.integers(k))],
            sample(k, np.zeros(1)),
            "",
            *wrong,
        ]
        return others[int(self.random.integers(len(others)))]


@pytest.mark.parametrize("seed", range(5))
def test_whatever_clients_answer_the_robot_gets_only_what_was_right(seed):
    client = Fuzzed(seed)
    limits = {"q_ref": AxisLimits(-0.9, 0.9, speed=50.0)}
    found = Controller(slide(), corrected, clients=[client], limits=limits).run(4.0)
    applied, said = found["applied.q_ref"], found["stream.delta"]
    assert np.isfinite(applied).all()
    assert np.abs(applied).max() <= 0.9
    assert np.abs(np.diff(applied)).max() <= 0.2 * (1 + 1e-12)
    right = np.array([0.0, *(math.sin(0.1 * k) for k in range(1000))])
    assert np.isin(said, right).all()  # whatever acts was an answer of its own, ...
    ages = [np.flatnonzero(right[: k + 1] == said[k])[-1] for k in range(1, 1001)]
    assert np.all(np.diff(ages) >= 0)  # ... and none comes back
    counts = found.timing.clients["stream"]
    assert counts.taken + counts.held + counts.stale + counts.refused >= 1000
    assert min(counts.taken, counts.held, counts.stale, counts.refused) > 0
    assert not counts.failure


def test_a_plant_that_breaks_is_told_with_its_time():
    part = PythonComponent(
        lambda t, v: {"q": math.nan if t > 0.1 else 0.0},
        inputs=[Channel("q_ref", "m")],
        outputs=[Channel("q", "m")],
        sampled=False,
    )
    with pytest.raises(SolveError, match=r"plant: found q = nan at t = 0.104 s, expected finite") as error:
        Controller(part, lambda t, v: {}).run(STOP)
    assert error.value.result.time.size == 26


@pytest.mark.parametrize("value", [lambda t: 1 / (t < 0.1), lambda t: 0.0 if t < 0.1 else math.nan])
def test_a_reference_that_breaks_leaves_what_was_run(value, plant):
    with pytest.raises(SolveError, match=r"references: q_ref.*t = 0\.1 s") as error:
        Controller(plant, lambda t, v: {}, references={"q_ref": value}).run(STOP)
    assert error.value.result.time.size == 25


class Tank(Model):
    """x' = u, until it is full."""

    u = Input(unit="m/s", start=0.0, description="what flows in")
    x = Output(unit="m", start=0.0, fixed=True, description="level")

    def equations(self):
        yield der(self.x) == self.u
        yield when(self.x > 0.05, terminate("the tank is full"))


def test_a_plant_that_ends_ends_the_run_with_its_words():
    found = Controller(Tank(), lambda t, v: {"u": 1.0}).run(STOP)
    assert found.ended == "the tank is full"
    assert found.final("x") == pytest.approx(0.048)  # the last sample before 0.05 m
    assert np.allclose(found["x"], found.time, atol=1e-9)


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("abc", "references: q_ref: found 'abc', expected a number or an array"),
        ([1.0, 2.0], "references: q_ref: found [1.0, 2.0], expected 1 finite number"),
        (math.nan, "references: q_ref: found nan, expected 1 finite number"),
    ],
)
def test_references_that_are_none_are_refused(value, said, plant):
    with pytest.raises(ModelError) as error:
        Controller(plant, lambda t, v: {}, references={"q_ref": value}).run(STOP)
    assert said in str(error.value)
