"""An FMU of a lag, and instances of it."""

from pathlib import Path
from zipfile import ZipFile

import pytest

from gantrytau import Input, Model, Output, Parameter, Real, der
from tests.fmu.runtime.raw_calls import Library


class Lag(Model):
    """First-order lag: T = 0 leaves no solution."""

    T = Parameter(1.0, unit="s", description="time constant")
    u = Input(description="input")
    x = Real(start=1.0, fixed=True, description="state")
    y = Output(description="output")

    def equations(self):
        yield der(self.x) == self.u - self.x / self.T
        yield self.y == 2 * self.x


@pytest.fixture(scope="module", params=[2, 3], ids=["fmi2", "fmi3"])
def lag(request, tmp_path_factory):
    """The library of an FMU of Lag, and the value references by name."""
    from fmpy import read_model_description

    from gantrytau_fmu import export_fmu

    folder: Path = tmp_path_factory.mktemp("lag")
    path = folder / "lag.fmu"
    export_fmu(Lag(), path, fmi="2.0" if request.param == 2 else "3.0")
    with ZipFile(path) as archive:
        binary = next(n for n in archive.namelist() if n.startswith("binaries/") and not n.endswith("/"))
        archive.extract(binary, folder)
    described = read_model_description(path)
    references = {variable.name: variable.valueReference for variable in described.modelVariables}
    token = described.guid if request.param == 2 else described.instantiationToken
    assert token
    return Library(folder / binary, request.param, token), references


@pytest.fixture
def names(lag):
    return lag[1]


@pytest.fixture
def instance(lag, request):
    """A new instance for Co-Simulation, or what the test asks for."""
    library, _ = lag
    library.messages.clear()
    made = library.instantiate(getattr(request, "param", "CoSimulation"))
    assert made
    yield made
    made.free()


@pytest.fixture
def exchange(lag):
    library, _ = lag
    library.messages.clear()
    made = library.instantiate("ModelExchange")
    assert made
    yield made
    made.free()
