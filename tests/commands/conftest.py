"""A terminal and a file with models of a user, for the tests of the command line."""

import json as json_text
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib
import pytest
from typer.testing import CliRunner

from gantrytau.commands.app import app

matplotlib.use("Agg")

MODELS = '''\
"""Models of a user."""
from gantrytau import Input, Model, Parameter, Real, der
from gantrytau_models import GantryTau, Pendulum, prototypes

print("loading")

class Cart(Model):
    """A cart that is pushed."""

    m = Parameter(unit="kg", description="mass")
    x = Real(unit="m", start=0.0, fixed=True)
    v = Real(unit="m/s", start=0.0, fixed=True)
    f = Input(unit="N", start=0.0)

    def equations(self):
        yield self.v == der(self.x)
        yield self.m * der(self.v) == self.f

class Misspelt(Cart):
    m = Parameter(1.0, unit="kg")

    def equations(self):
        yield self.v == der(self.x)
        yield self.m * der(self.v) == self.force

class Divided(Cart):
    m = Parameter(1.0, unit="kg")

    def equations(self):
        yield self.v == der(self.x)
        yield self.m * der(self.v) == self.f / (1 // 0)

class Unfinished(Cart):
    m = Parameter(1.0, unit="kg")

    def equations(self):
        yield self.v == der(self.x)

class Runaway(Model):
    """Its solution 1 / (1 - t) has a pole at t = 1 s."""

    x = Real(unit="1", start=1.0, fixed=True)
    per_second = Parameter(1.0, unit="1/s")

    def equations(self):
        yield der(self.x) == self.per_second * self.x**2

class Needy(Cart):
    def __init__(self, mass, **modifications):
        super().__init__(dict(m=mass), **modifications)

class Painted(Model):
    """Names and units that look like markup."""

    level = Real(unit="m", description="[bold]level[/bold]", start=1.0, fixed=True)
    rate = Parameter(1.0, unit="1/s")

    def equations(self):
        yield der(self.level) == -self.rate * self.level

robot = GantryTau(prototypes.D1)
number = 3
'''


@pytest.fixture
def run() -> Callable[..., Any]:
    """Call the command line: `run("check", "Pendulum")`."""

    def call(*arguments: object) -> Any:
        return CliRunner().invoke(app, [str(argument) for argument in arguments], env={"COLUMNS": "200"})

    return call


@pytest.fixture
def answer(run: Callable[..., Any]) -> Callable[..., Any]:
    """What a command that succeeds prints as JSON."""

    def call(*arguments: object) -> Any:
        found = run(*arguments, "--json")
        assert found.exit_code == 0, found.output
        return json_text.loads(found.stdout)

    return call


@pytest.fixture
def fails(run: Callable[..., Any]) -> Callable[..., str]:
    """The message of a command that fails with an exit code, the same in words and as JSON."""

    def call(code: int, *arguments: object) -> str:
        spoken, printed = run(*arguments), run(*arguments, "--json")
        assert (spoken.exit_code, printed.exit_code) == (code, code), spoken.output
        message = json_text.loads(printed.stdout)["error"]
        assert message in spoken.stderr
        assert "Traceback" not in spoken.output + printed.output
        return message

    return call


@pytest.fixture
def robots(tmp_path: Path) -> Path:
    """A file with models of a user."""
    file = tmp_path / "robots.py"
    file.write_text(MODELS)
    return file
