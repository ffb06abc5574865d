"""Units, display units and declared types of the variables of an FMU.

FMI 3.0.2, sections 2.4.3 and 2.4.4; FMI 2.0.4, sections 2.2.2 and 2.2.3. The radian counts as a base unit there.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from gantrytau.border.dimensions import BASE, dimension, radians
from gantrytau.border.refusal import ModelError
from gantrytau.border.units import scale
from gantrytau_fmu.describing.xml_text import element, parent
from gantrytau_fmu.description import FmuVariable

# Names as in Modelica.Units.SI, where one unit has one meaning.
QUANTITIES = {
    "m": "Length",
    "m2": "Area",
    "m3": "Volume",
    "s": "Time",
    "m/s": "Velocity",
    "m/s2": "Acceleration",
    "m/s3": "Jerk",
    "rad": "Angle",
    "rad/s": "AngularVelocity",
    "rad/s2": "AngularAcceleration",
    "rad/s3": "AngularJerk",
    "sr": "SolidAngle",
    "kg": "Mass",
    "kg/m3": "Density",
    "kg.m2": "Inertia",
    "kg.m/s": "Momentum",
    "kg.m2/s": "AngularMomentum",
    "N": "Force",
    "N.m": "Torque",
    "N.s": "Impulse",
    "N/m": "TranslationalSpringConstant",
    "N.s/m": "TranslationalDampingConstant",
    "N.m/rad": "RotationalSpringConstant",
    "N.m.s/rad": "RotationalDampingConstant",
    "J": "Energy",
    "W": "Power",
    "Pa": "Pressure",
    "Hz": "Frequency",
    "K": "Temperature",
    "A": "ElectricCurrent",
    "V": "Voltage",
    "C": "ElectricCharge",
    "Ohm": "Resistance",
    "S": "Conductance",
    "H": "Inductance",
    "F": "Capacitance",
    "Wb": "MagneticFlux",
    "T": "MagneticFluxDensity",
    "mol": "AmountOfSubstance",
    "cd": "LuminousIntensity",
}
DISPLAYS = {  # units that tools offer, besides those that declarations name; the first by default, of DEFAULT_DISPLAY
    "rad": ("deg",),
    "rad/s": ("deg/s", "rev/min"),
    "rad/s2": ("deg/s2",),
    "m": ("mm",),
    "m/s": ("mm/s",),
    "m/s2": ("mm/s2",),
    "s": ("ms",),
    "kg": ("g",),
    "N": ("kN",),
    "Pa": ("bar",),
    "W": ("kW",),
    "K": ("degC",),
}
DEFAULT_DISPLAY = ("rad", "rad/s", "rad/s2", "m", "m/s", "K")


@dataclass(frozen=True)
class DeclaredType:
    """What variables of one unit share; quantity: None where the unit does not tell it.

    display: the unit in which they are shown; displays: all that are defined.
    """

    name: str
    unit: str
    quantity: str | None
    display: str | None
    displays: tuple[str, ...] = ()


def declared_types(variables: Sequence[FmuVariable]) -> dict[str, DeclaredType]:
    """The type of each unit of real variables, in the order of their first use; "" and "1" have none.

    Names of types differ from each other and from those of all variables, as both standards demand. Raises
    ModelError for a text that is no unit, and names the variable.
    """
    taken = {variable.name for variable in variables}
    types: dict[str, DeclaredType] = {}
    for variable in variables:
        unit = variable.unit
        if unit in types or unit in ("", "1") or not variable.real:
            continue
        try:
            dimension(unit)
        except ModelError as error:
            raise ModelError(f"variable '{variable.name}': {error}") from error
        name = QUANTITIES.get(unit) or _made_up(unit)
        while name in taken:
            name += "_"
        taken.add(name)
        display = DISPLAYS[unit][0] if unit in DEFAULT_DISPLAY else None
        shown = (v.display for v in variables if v.real and v.unit == unit and v.display)
        displays = tuple(dict.fromkeys((*DISPLAYS.get(unit, ()), *shown)))
        types[unit] = DeclaredType(name, unit, QUANTITIES.get(unit), display, displays)
    return types


def _made_up(unit: str) -> str:
    """`In_kg_m2_per_s3` for "kg.m2/s3": a legal name in the structured naming convention."""
    text = unit.replace(" ", "").replace("/", "_per_").replace(".", "_").replace("-", "minus")
    return "In_" + "".join(letter for letter in text if letter.isalnum() or letter == "_")


def unit_definitions(types: Iterable[DeclaredType]) -> str:
    """The element `UnitDefinitions`, which both versions write alike; "" without units."""
    return parent("UnitDefinitions", [_unit(declared) for declared in types])


def _unit(declared: DeclaredType) -> str:
    unit = declared.unit
    powers = {base: int(power) for base, power in zip(BASE, dimension(unit), strict=True) if power}
    if turns := radians(unit):
        powers["rad"] = turns
    inside = element("BaseUnit", powers)
    for name in declared.displays:  # display = factor * value + offset
        shown = scale(name)
        factor = replace(shown, zero=0.0).written(1.0)
        inside += element("DisplayUnit", {"name": name, "factor": factor, "offset": -shown.zero or None})
    return element("Unit", {"name": unit}, "\n" + inside)
