"""Units, display units and declared types of FMUs, as FMPy reads them."""

import numpy as np
import pytest

from gantrytau_fmu.description import FmuVariable
from tests.fmu.interfaces import VERSIONS, description, read

# exponents of kg, m, s, rad, taken by hand from the definitions of the units
EXPONENTS = {
    "N": (1, 1, -2, 0),
    "N.m": (1, 2, -2, 0),
    "kg.m2": (1, 2, 0, 0),
    "N/m": (1, 0, -2, 0),
    "N.m/rad": (1, 2, -2, -1),
    "N.m.s/rad": (1, 2, -1, -1),
    "rad/s2": (0, 0, -2, 1),
    "rad/m": (0, -1, 0, 1),
    "W": (1, 2, -3, 0),
    "Hz": (0, 0, -1, 0),
    "N.m/(rad.s2)": (1, 2, -4, -1),
    "rad2": (0, 0, 0, 2),
}


@pytest.mark.parametrize("fmi", VERSIONS)
def test_units_are_defined_by_base_units_and_the_radian(fmi):
    told = description(
        *(FmuVariable(f"p[{k}]", 0, "parameter", "fixed", start=1.0, unit=u) for k, u in enumerate(EXPONENTS))
    )
    found = {u.name: u.baseUnit for u in read(told, fmi).unitDefinitions}
    assert {name: (b.kg, b.m, b.s, b.rad) for name, b in found.items() if name != "s"} == EXPONENTS
    assert all((b.A, b.K, b.mol, b.cd, b.factor, b.offset) == (0, 0, 0, 0, 1, 0) for b in found.values())


@pytest.mark.parametrize("fmi", VERSIONS)
def test_types_carry_quantity_unit_and_display_unit(fmi):
    angle, speed, heat, odd = (
        FmuVariable(name, 0, "parameter", "fixed", start=1.0, unit=unit)
        for name, unit in (("phi", "rad"), ("Velocity", "m/s"), ("T", "K"), ("x", "kg.m2/s3"))
    )
    found = read(description(angle, speed, heat, odd), fmi)
    types = [v.declaredType for v in found.modelVariables[1:]]
    assert [(t.quantity, t.unit, t.displayUnit) for t in types] == [
        ("Angle", "rad", "deg"),
        ("Velocity", "m/s", "mm/s"),
        ("Temperature", "K", "degC"),
        (None, "kg.m2/s3", None),
    ]
    assert types[0].name == "Angle"
    assert types[1].name != "Velocity"  # a type must not have the name of a variable
    displays = {d.name: d for u in found.unitDefinitions for d in u.displayUnits}
    convert = {name: lambda x, d=d: float(d.factor) * x + float(d.offset) for name, d in displays.items()}
    assert convert["deg"](np.pi) == pytest.approx(180, rel=1e-15)  # one rounding
    assert convert["degC"](300.0) == pytest.approx(26.85, abs=1e-13)  # the rounding of 300 - 273.15
    assert convert["mm/s"](1.5) == 1500.0


@pytest.mark.parametrize("fmi", VERSIONS)
def test_declared_display_units_are_defined_and_named_by_their_variables(fmi):
    shown = {
        "phi": ("rad", "rev", 1 / (2 * np.pi), 0.0),
        "psi": ("rad", "", 0.0, 0.0),
        "plain": ("rad", "rad", 1.0, 0.0),
        "w": ("rad/s", "rpm", 30 / np.pi, 0.0),
        "T": ("K", "degF", 1.8, -459.67),
        "v": ("m/s", "km/h", 3.6, 0.0),
        "x": ("kg.m2/s3", "kW", 1e-3, 0.0),
    }
    told = (
        FmuVariable(name, 0, "parameter", "fixed", start=1.0, unit=unit, display=display)
        for name, (unit, display, _, _) in shown.items()
    )
    found = read(description(*told), fmi)
    defined = {(u.name, d.name): d for u in found.unitDefinitions for d in u.displayUnits}
    variables = {v.name: v for v in found.modelVariables}
    for name, (unit, display, factor, offset) in shown.items():
        assert variables[name].displayUnit == (display or None)
        if display:
            one = defined[unit, display]
            assert float(one.factor or 1.0) == pytest.approx(factor, rel=1e-15), name
            assert float(one.offset or 0.0) == offset
    assert variables["psi"].declaredType.displayUnit == "deg"
    assert float(defined["rad/s", "rev/min"].factor) * 2 * np.pi / 60 == pytest.approx(
        1, rel=1e-15
    )  # one turn a second is 60 a minute


@pytest.mark.parametrize("fmi", VERSIONS)
def test_what_has_no_unit_declares_none(fmi):
    found = read(description(FmuVariable("k", 0, "parameter", "fixed", start=1.0, unit="1")), fmi)
    assert [u.name for u in found.unitDefinitions] == ["s"]
    assert (found.modelVariables[1].unit, found.modelVariables[1].declaredType) == (None, None)


def test_units_that_look_alike_get_types_of_their_own():
    told = description(
        *(
            FmuVariable(n, 0, "parameter", "fixed", start=1.0, unit=u)
            for n, u in (("a", "m/s.s"), ("b", "m/(s.s)"))
        )
    )
    names = {v.declaredType.name for v in read(told, "3.0").modelVariables}
    assert len(names) == 3
