"""Optima on file: what is read back answers as what was written, starts others, and damage is told."""

import json
import os
import warnings
import zipfile
from functools import cache
from typing import Any

import numpy as np
import pytest

from gantrytau import Input, Model, ModelError, Parameter, Real, SolveError, der, exp
from gantrytau_optimica import Free, Optimization, final, initial, link, optimize
from gantrytau_optimica.answers.archive.optimum_files import load_optimum, save_optimum
from gantrytau_optimica.answers.archive.saved_optimum import MissingGuess
from tests.optimica.problems import FastestMass, FastestOscillator, Mass


class Heated(Model):
    """A mass whose motor warms up: a variable that is a square, one by a vector, one that needs iteration."""

    x = Real(unit="m", description="position")
    v = Real(unit="m/s", description="speed")
    u = Input(unit="m/s2", min=-1.0, max=1.0, description="force per mass")
    heat = Real(description="square of the force")
    pair = Real(2, description="two signals")
    steep = Real(start=0.0, description="root of steep + steep^3 = v")

    def equations(self):
        yield der(self.x) == self.v
        yield der(self.v) == self.u
        yield self.heat == (self.u / self.u_one) ** 2
        yield self.pair[0] == 2 * self.v / self.v_one + 3
        yield self.pair[1] == self.steep - 1
        yield self.steep + self.steep**3 == self.v / self.v_one

    u_one = Parameter(1.0, unit="m/s2", description="one")
    v_one = Parameter(1.0, unit="m/s", description="one")


class Warm(FastestMass):
    """The fastest motion of it."""

    mass: Any = Heated()


class Leg(Optimization):
    """A rest-to-rest move."""

    mass = Mass(u=dict(min=-1.0, max=1.0))

    def integrand(self):
        return 0.0


class ThereAndOn(Optimization):
    """Two moves of 1 m with a stop."""

    class First(Leg):
        final_time = Free(1.5, unit="s", min=0.1, description="end of the first")

        def constraints(self):
            yield initial(self.mass.x) == 0
            yield initial(self.mass.v) == 0
            yield final(self.mass.v) == 0
            yield final(self.mass.x) == 1

    class Second(Leg):
        start_time = Free(1.5, unit="s", min=1.9, max=2.5, description="start of the second")
        final_time = Free(4.0, unit="s", min=3.0, description="end of the second")

        def constraints(self):
            yield final(self.mass.x) == 2
            yield final(self.mass.v) == 0

    one = First()
    two = Second()

    def objective(self):
        return self.two.final_time

    def constraints(self):
        yield link(self.one, self.two)


@cache
def solved(scheme: Any = "radau", **policy: Any):
    return optimize(Warm, elements=8, scheme=scheme, **policy)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "warm.optimum"


@pytest.mark.parametrize("scheme", ["radau", "gauss"])
def test_what_is_read_back_answers_as_the_original(path, scheme):
    original = solved(scheme)
    assert save_optimum(original, path) == path
    copy = load_optimum(path)
    assert copy.name == "Warm"
    assert copy.success
    assert copy.status == original.status
    for word in ("objective", "free", "iterations", "start_time", "final_time", "solve_time", "build_time"):
        assert getattr(copy, word) == getattr(original, word)
    assert copy.report() == original.report()
    np.testing.assert_array_equal(copy.time, original.time)
    np.testing.assert_array_equal(copy.breaks, original.breaks)
    assert copy.names == original.names
    for name in (*original.names, "mass.pair", "der(mass.v)"):  # round-off of other orders of summation
        np.testing.assert_allclose(copy[name], original[name], rtol=1e-9, atol=1e-12, err_msg=name)
    assert copy["final_time"] == original.final_time
    assert "final_time" in copy
    assert "mass.u" in list(copy)
    assert copy.final("mass.x") == pytest.approx(1.0, abs=1e-8)  # the solver's tolerance


@pytest.mark.parametrize("scheme", ["radau", "gauss"])
@pytest.mark.parametrize("name", ["mass.x", "mass.v", "mass.u", "mass.steep", "mass.pair", "mass.heat"])
def test_signals_are_the_same_polynomials(path, scheme, name):
    original = solved(scheme)
    save_optimum(original, path)
    times = np.linspace(0.0, original.final_time, 357)
    found, expected = load_optimum(path).signal(name)(times), original.signal(name)(times)
    assert found.shape == expected.shape
    # sums of signals, and the square of one, are polynomials of the degree that is kept
    np.testing.assert_allclose(found, expected, atol=1e-10)
    assert load_optimum(path).signal(name)(0.3).shape == expected[0].shape


def test_the_error_of_other_variables_falls_with_the_mesh(path):
    class Bent(Warm):
        speed = Real(description="the exponential of the speed")

        def equations(self):

            yield self.speed == exp(self.mass.v / self.mass.v_one)

    errors = []
    for elements in (2, 4):
        original = optimize(Bent, elements=elements)
        save_optimum(original, path)
        times = np.linspace(0.0, original.final_time, 357)
        errors.append(
            np.max(np.abs(load_optimum(path).signal("speed")(times) - original.signal("speed")(times)))
        )
    # polynomials of degree 6: halving the elements divides the error by 2^7
    assert np.log2(errors[0] / errors[1]) > 5.5


def test_inputs_in_pieces_moving_borders_and_moving_times(path):
    original = optimize(Warm, elements=[1, 2, 3, 2], lengths="free", controls={"mass.u": "constant"})
    save_optimum(original, path)
    copy = load_optimum(path)
    np.testing.assert_array_equal(copy.breaks, original.breaks)
    assert np.ptp(np.diff(copy.phases[""].borders)) > 0.01
    times = np.linspace(0.0, original.final_time, 99)
    np.testing.assert_allclose(copy.signal("mass.u")(times), original.signal("mass.u")(times), atol=1e-10)


def test_phases_keep_their_clocks(path):
    original = optimize(ThereAndOn, elements=6)
    save_optimum(original, path)
    copy = load_optimum(path)
    assert copy.final_time == original.final_time == pytest.approx(4.0, abs=1e-6)  # 2 s for each metre
    assert list(copy.phases) == ["one", "two"]
    np.testing.assert_allclose(copy["two.mass.x"], original["two.mass.x"], rtol=1e-12)
    with pytest.raises(ModelError, match=r"has phases with times of their own; ask one of .*'one', 'two'"):
        copy.time  # noqa: B018
    again = optimize(ThereAndOn, elements=6, guess=copy)
    assert again.objective == pytest.approx(4.0, abs=1e-6)


def test_a_saved_solution_starts_the_same_problem_on_another_mesh(path):
    cold = optimize(FastestOscillator, elements=40)
    save_optimum(cold, path)
    warm = optimize(FastestOscillator, elements=53, points=2, guess=load_optimum(path))
    assert warm.objective == pytest.approx(2.28115871, abs=2e-4)  # coarser by a degree
    first = optimize_guess(FastestOscillator, load_optimum(path))
    assert first["final_time"] == cold.final_time


def optimize_guess(problem, guess) -> dict[str, Any]:
    """What the first guess is before anything is solved: by name, free numbers included."""
    from gantrytau_optimica import prepare

    prepared = prepare(problem, elements=4, guess=guess)
    return {n.name: n.guess for n in prepared.built.problem.free} | {
        s.name: s.guess for s in prepared.built.problem.signals
    }


def test_the_guess_is_the_saved_polynomial(path):
    original = solved()
    save_optimum(original, path)
    guess = optimize_guess(Warm, load_optimum(path))
    shares = np.linspace(0.0, 1.0, 41)
    for name in ("mass.x", "mass.v", "mass.u"):
        expected = original.signal(name)(shares * original.final_time)
        np.testing.assert_allclose(guess[name](shares), expected, atol=1e-9)


def test_a_changed_model_takes_what_it_knows_and_says_what_is_missing(path):
    class Trolley(Heated):
        load = Real(unit="m", start=0.25, description="follows the position")

        def equations(self):
            yield from super().equations()
            yield der(self.load) == self.v

    class Changed(Warm):
        mass: Any = Trolley()

    save_optimum(solved(), path)
    with pytest.warns(MissingGuess, match=r"the saved Warm has no mass\.load; they start from their default"):
        guess = optimize_guess(Changed, load_optimum(path))
    assert guess["mass.load"](np.array([0.0, 1.0])) == pytest.approx([0.25, 0.25])
    assert guess["mass.x"](np.array([1.0])) == pytest.approx([1.0], abs=1e-6)


def test_the_same_model_is_taken_silently(path):
    save_optimum(solved(), path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert optimize(Warm, elements=5, guess=load_optimum(path)).success


def test_a_model_with_other_names_is_refused(path):
    save_optimum(solved(), path)
    with pytest.raises(ModelError, match="saved Warm has none of the variables of FastestOscillator"):
        optimize(FastestOscillator, guess=load_optimum(path))


def test_parameters_units_and_unknown_names(path):
    save_optimum(solved(), path)
    copy = load_optimum(path)
    assert copy["mass.v_one"] == pytest.approx(np.ones(copy.time.size))
    assert copy.result.unit("mass.x") == "m"
    assert copy.result.description("mass.v") == "speed"
    np.testing.assert_array_equal(copy["time"], copy.time)
    with pytest.raises(ModelError, match=r"Warm has no variable or parameter 'mass.y'; did you mean"):
        copy["mass.y"]
    with pytest.raises(ModelError, match="Warm has no variable"):
        copy.signal("der(mass.u)")  # the equations do not determine it
    assert copy.versions["gantrytau"]
    assert len(copy.hashes["equations"]) == 16


def test_an_unfinished_solution_is_kept_with_its_report(path):
    with pytest.raises(SolveError) as caught:
        optimize(Warm, elements=5, max_iterations=2)
    save_optimum(caught.value.optimum, path)
    copy = load_optimum(path)
    assert not copy.success
    assert copy.status == "iteration limit reached"
    assert "Not met" in copy.report()


def test_other_suffixes_and_missing_folders_are_refused(tmp_path):
    with pytest.raises(ModelError, match=r"found the suffix '\.nc', expected '\.optimum'"):
        save_optimum(solved(), tmp_path / "a.nc")
    with pytest.raises(ModelError, match="does not exist; create it"):
        save_optimum(solved(), tmp_path / "none" / "a.optimum")
    with pytest.raises(ModelError, match="there is no such file"):
        load_optimum(tmp_path / "none.optimum")
    with pytest.raises(ModelError, match="Is a directory; expected a file that can be read"):
        load_optimum(tmp_path)


def test_a_failing_write_leaves_the_old_file(path, monkeypatch):
    save_optimum(solved(), path)
    before = path.read_bytes()

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np.lib.format, "write_array", full)
    with pytest.raises(OSError, match="No space left"):
        save_optimum(solved(), path)
    assert path.read_bytes() == before
    assert os.listdir(path.parent) == [path.name]


def test_foreign_files_are_told(path):
    for content in (b"", b"time,x\n0,1\n", os.urandom(300)):
        path.write_bytes(content)
        with pytest.raises(ModelError, match="found no whole saved optimum"):
            load_optimum(path)
    np.savez(path.with_suffix(".npz"), a=np.zeros(3))
    with pytest.raises(ModelError, match=r"an archive without header\.json"):
        load_optimum(path.with_suffix(".npz"))
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("header.json", "[1, 2]")
    with pytest.raises(ModelError, match="found an archive of another kind"):
        load_optimum(path)


def changed(path, change):
    """The file with its header changed."""
    with zipfile.ZipFile(path) as archive:
        members = {info.filename: archive.read(info) for info in archive.infolist()}
    header = json.loads(members["header.json"])
    change(header)
    members["header.json"] = json.dumps(header).encode()
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)


def test_a_newer_format_is_told(path):
    save_optimum(solved(), path)
    changed(path, lambda h: h.update(version=2, versions={"gantrytau": "9.1"}))
    with pytest.raises(ModelError, match=r"format 2, written by gantrytau 9\.1; expected at most 1; update"):
        load_optimum(path)


@pytest.mark.parametrize("key", ["w", "phases", "free", "objective", "vectors"])
def test_a_header_that_lacks_something_is_told(path, key):
    save_optimum(solved(), path)
    changed(path, lambda h: h.pop(key, None) if key != "w" else h["phases"][0]["states"].append("more"))
    with pytest.raises(ModelError, match="found no whole saved optimum"):
        load_optimum(path)


@pytest.mark.parametrize(
    "change",
    [
        lambda h: h.update(phases=[]),
        lambda h: h["phases"][0].update(final_time=h["phases"][0]["start_time"]),
        lambda h: h["phases"][0].update(final_time=-1.0),
    ],
)
def test_a_header_without_a_horizon_is_told(path, change):
    save_optimum(solved(), path)
    changed(path, change)
    with pytest.raises(ModelError, match="found no whole saved optimum"):
        load_optimum(path)


def test_compressed_and_pickled_members_are_refused(path):
    save_optimum(solved(), path)
    with zipfile.ZipFile(path) as archive:
        members = {info.filename: archive.read(info) for info in archive.infolist()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    with pytest.raises(ModelError, match=r"header\.json is compressed"):
        load_optimum(path)
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in members.items():
            if name != "w.npy":
                archive.writestr(name, content)
        with archive.open("w.npy", "w") as member:
            np.lib.format.write_array(member, np.array([{"a": 1}], dtype=object))
    with pytest.raises(ModelError, match="found no whole saved optimum"):
        load_optimum(path)


def test_cut_files_are_told_and_flipped_bits_never_pass_for_the_original(path):
    save_optimum(solved(), path)
    content = path.read_bytes()
    original = load_optimum(path)
    for size in np.linspace(0, len(content) - 1, 60).astype(int):
        path.write_bytes(content[:size])
        with pytest.raises(ModelError, match="found no whole saved optimum"):
            load_optimum(path)
    generator, refused = np.random.default_rng(4), 0
    for place in generator.integers(0, len(content), 300):
        damaged = bytearray(content)
        damaged[place] ^= 1 << int(generator.integers(8))
        path.write_bytes(bytes(damaged))
        try:
            copy = load_optimum(path)
        except ModelError:
            refused += 1
            continue
        # what no checksum covers, as the date of a member, changes nothing
        np.testing.assert_array_equal(copy.signal("mass.u")(original.time), original["mass.u"])
        assert copy.objective == original.objective
    assert refused > 200
