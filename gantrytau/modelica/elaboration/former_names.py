"""Names of the Modelica Standard Library before version 4, which texts of that time use."""

from gantrytau.modelica.elaboration.scopes import ClassScope

FORMER = {
    "Modelica.SIunits": "Modelica.Units.SI",
    "Modelica.Units.SI.Conversions": "Modelica.Units.Conversions",
    "Modelica.Units.Conversions.NonSIunits": "Modelica.Units.NonSI",
    "Modelica.Units.SI.Temp_K": "Modelica.Units.SI.Temperature",
    "Modelica.Units.SI.Temp_C": "Modelica.Units.NonSI.Temperature_degC",
}


def renamed(package: ClassScope, name: str) -> ClassScope | None:
    """The class of today that a former name in a package means; None where there is none."""
    if package.name != "Modelica" or f"Modelica.{name}" not in FORMER:
        return None
    found = _today(package, f"Modelica.{name}")
    for former in FORMER:
        around, _, last = former.rpartition(".")
        if around == found.name and found.own_class(last) is None:
            found.classes[last] = _today(package, former)
    return found


def _today(package: ClassScope, former: str) -> ClassScope:
    _, *path = FORMER[former].split(".")
    found = package.at_path(path)
    if found is None:
        raise KeyError(FORMER[former])
    return found
