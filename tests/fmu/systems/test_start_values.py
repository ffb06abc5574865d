"""Values that components begin with: limits, what cannot be set, inputs that nothing drives."""

import re
import warnings
import zipfile

import pytest

from gantrytau import ModelError, Samples
from gantrytau_fmu.systems.connected_system import UnconnectedInputs
from gantrytau_fmu.systems.cosimulate import cosimulate
from tests.fmu.systems.small_fmus import variable


def spring(build, fmi="2.0"):
    """A stiffness k and what follows from it."""
    lines = [variable("k", "parameter", 100.0, unit="N/m"), variable("y", "output", unit="N/m")]
    return build(f"spring{fmi[0]}", lines, derive="v[1] = v[0];", fmi=fmi)


def with_limits(file, folder, name, least=None, greatest=None):
    """The same FMU with limits of a variable."""
    limits = "".join(f' {key}="{x}"' for key, x in (("min", least), ("max", greatest)) if x is not None)
    copy = folder / f"limited_{file.name}"
    with zipfile.ZipFile(file) as archive, zipfile.ZipFile(copy, "w") as changed:
        for member in archive.namelist():
            content = archive.read(member)
            if member == "modelDescription.xml":
                place = re.compile(rf'(name="{name}"[^>]*>\s*<Real|<Float64[^>]*name="{name}")')
                content = place.sub(rf"\1{limits}", content.decode()).encode()
            changed.writestr(member, content)
    return copy


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize(
    ("limits", "good", "bad", "words"),
    [
        ((0, 200), (0.0, 200.0), 200.5, r"found 200\.5, expected at least 0 and at most 200 N/m, as its FMU"),
        ((-5, None), (-5.0, 1e9), -6, r"found -6, expected at least -5 N/m"),
        ((None, 7.5), (-1e9, 7.5), 8.0, r"found 8, expected at most 7\.5 N/m"),
    ],
)
def test_start_values_outside_of_the_limits_are_refused(build, tmp_path, fmi, limits, good, bad, words):
    file = with_limits(spring(build, fmi), tmp_path, "k", *limits)
    for value in good:
        cosimulate({"a": file}, stop=0.1, step=0.1, start={"a.k": value})
    with pytest.raises(ModelError, match=rf"start: a\.k: {words}"):
        cosimulate({"a": file}, stop=0.1, step=0.1, start={"a.k": bad})


def test_inputs_that_nothing_drives_are_told_once(build):
    many = [variable(f"u[{k}]", "input", 0.5 * k, unit="N") for k in range(8)] + [variable("y", "output")]
    files = {"a": build("many", many), "b": spring(build)}
    with pytest.warns(UnconnectedInputs) as told:
        found = cosimulate(files, stop=0.1, step=0.1, start={"a.u[0]": 7.0}, inputs={"a.u[2]": 1.0})
    (words,) = [str(warning.message) for warning in told]
    assert words == (
        "nothing drives 6 inputs, which keep their values: a.u[1] = 0.5, a.u[3] = 1.5, a.u[4] = 2, a.u[5] = 2.5, "
        "a.u[6] = 3 and 1 more; give them with inputs= or start="
    )
    assert told[0].filename == __file__  # it points to the call
    assert found["a.u[7]"] == pytest.approx([3.5, 3.5])
    with pytest.warns(
        UnconnectedInputs, match=r"nothing drives 1 input, which keeps its value: a\.u\[1\] = 0\.5; give it"
    ):
        cosimulate(files, stop=0.1, step=0.1, inputs={f"a.u[{k}]": 0 for k in range(8) if k != 1})


def test_a_component_by_itself_and_inputs_that_are_given_are_silent(build):
    lines = [variable("u", "input", 0.5), variable("y", "output", 1.0)]
    file = build("silent", lines)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        alone = cosimulate({"a": file}, stop=0.1, step=0.1)
        two = cosimulate({"a": file, "b": file}, [("a.y", "b.u")], stop=0.1, step=0.1, start={"a.u": 0.25})
    assert alone["a.u"] == pytest.approx([0.5, 0.5])
    assert two["a.u"] == pytest.approx([0.25, 0.25])
    assert two["b.u"] == pytest.approx([1.0, 1.0])


def test_what_cannot_be_set_says_what_can(build):
    lines = [variable("y", "output"), variable("x", "local", 1.0), variable("w", "local")]
    with pytest.raises(ModelError, match=r"start: a\.y: .*, expected .* variable with a start value, such"):
        cosimulate({"a": build("states", lines)}, stop=1.0, step=0.1, start={"a.y": 1.0})
    with pytest.raises(ModelError, match=r"inputs: a\.u: a has no variable 'u'; it has no input$"):
        cosimulate({"a": build("states", lines)}, stop=1.0, step=0.1, inputs={"a.u": 1.0})


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_start_values_may_bring_their_units(build, fmi):
    system = {"a": spring(build, fmi)}
    assert cosimulate(system, stop=0.1, step=0.1, start={"a.k": "2 N/mm"}).final("a.y") == 2000.0
    with pytest.raises(ModelError, match=r"start: a\.k: found '2 mm', a length, expected a stiffness in N/m"):
        cosimulate(system, stop=0.1, step=0.1, start={"a.k": "2 mm"})


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_an_fmu_in_other_units_is_given_them(build, fmi):
    lines = [variable("u", "input", 0.0, unit="mm"), variable("T", "parameter", 20.0, unit="degC")]
    lines += [variable("y", "output", unit="mm"), variable("odd", "parameter", 1.0, unit="furlong")]
    system = {"a": build(f"metric{fmi[0]}", lines, derive="v[2] = v[0] + v[1];", fmi=fmi)}
    assert (
        cosimulate(system, stop=0.1, step=0.1, start={"a.u": "1 m", "a.T": "300 K"}).final("a.y") == 1026.85
    )
    driven = cosimulate(system, stop=0.1, step=0.1, inputs={"a.u": Samples([0.0, 0.1], [2.0, 2.0], unit="m")})
    assert driven.final("a.y") == 2020.0
    with pytest.raises(ModelError, match=r"start: a\.T: found '1 m', a length, expected a temperature in K"):
        cosimulate(system, stop=0.1, step=0.1, start={"a.T": "1 m"})
    with pytest.raises(ModelError, match=r"start: a\.odd: found '1 m', expected numbers in 'furlong'"):
        cosimulate(system, stop=0.1, step=0.1, start={"a.odd": "1 m"})
