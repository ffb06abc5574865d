"""Models that put the runtime to the proof, each exported once and unpacked: library, sources, value references."""

import atexit
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal
from zipfile import ZipFile

import pytest

from gantrytau import (
    Discrete,
    Input,
    Model,
    Output,
    Parameter,
    Real,
    connect,
    delay,
    der,
    exp,
    fabs,
    floor,
    if_else,
    mod,
    pre,
    reinit,
    sampled,
    sin,
    terminate,
    time,
    when,
)
from gantrytau.mechanics.translational import Force, Mass, StickSlipFriction
from gantrytau_fmu import export_fmu
from gantrytau_models import FourBar, GantryTau, Pendulum, SixLinkGantryTau, prototypes
from tests.fmu.binaries_kept import binary
from tests.simulation.test_impulses import ChargedByVoltage

DRIVERS = Path(__file__).parent / "c"


class Sledge(Model):
    """A mass that sticks and slips under a given force, a sine and a sampled controller: all kinds of events."""

    gain = Parameter(40.0, unit="N/m", description="of the controller")
    period = Parameter(0.01, unit="s", description="of the controller")
    w = Parameter(5.0, unit="rad/s", description="of the sine")
    sway = Parameter(6.0, unit="N", description="amplitude of the sine")
    push = Input(unit="N", description="additional force", start=0.0)
    held = Real(unit="N", description="force of the controller", start=0.0)
    s = Output(unit="m", description="position")
    mass = Mass(m=2.0, s=dict(start=0.3, fixed=True), v=dict(start=0.0, fixed=True))
    floor = StickSlipFriction(f_c=2.0, f_v=0.5, f_s=3.0)
    motor = Force()

    def equations(self):
        yield connect(self.motor.flange, self.mass.flange)
        yield connect(self.floor.flange, self.mass.flange)
        yield self.s == self.mass.s
        yield self.motor.f == self.push + self.held + self.sway * sin(self.w * time)
        yield sampled(self.held, -self.gain * self.s, period=self.period)


class Juggled(Model):
    """A ball thrown up again wherever it lands: conditions, counts, pulses, a sample, a block that is iterated."""

    e = Parameter(0.7, description="restitution")
    push = Input(start=0.0, description="acceleration")
    h = Real(start=0.3, fixed=True, description="height")
    v = Real(start=0.0, fixed=True, description="speed")
    drag = Real(start=0.0, description="of the air, which depends on itself")
    seen = Real(start=0.0, description="sample of the height")
    n = Discrete(0.0, description="bounces")
    y = Output(description="steps of 0.1 in height")

    def equations(self):
        yield der(self.h) == self.v
        kick = if_else(mod(time, 0.05) < 0.01, 2.0, 0.0)
        yield der(self.v) == self.push + kick - 9.81 - self.drag + self.y / 10 - self.seen
        yield self.drag + 0.1 * exp(self.drag) == 0.1 + self.v * fabs(self.v)
        yield self.y == floor(10 * self.h)
        yield sampled(self.seen, self.h, period=0.02)
        yield when(self.h <= 0, reinit(self.v, -self.e * pre(self.v)), self.n == pre(self.n) + 1)
        yield when(self.n >= 10_000, terminate("many bounces"))


class Late(Model):
    """Juggling that looks back: at the ball, at a sample, at an unknown that is iterated, and at the input."""

    push = Input(start=0.0, description="acceleration")
    T = Parameter(0.03, unit="s", description="delay")
    ball = Juggled()
    x = Real(start=0.0, fixed=True, description="follows what was")
    y = Output(description="what was")

    def equations(self):
        yield self.ball.push == delay(self.push, self.T)
        yield self.y == delay(self.ball.h, self.T) + delay(self.ball.drag, 0.011)
        yield der(self.x) == self.y + delay(self.ball.seen, 2 * self.T) - self.x


class Root(Model):
    """der(x) = -sqrt(x) + u / x comes to an end at x = 0, where nothing is defined any more."""

    u = Input(description="slows the end", start=0.0)
    x = Real(start=1.0, fixed=True, description="state")
    y = Output(description="root of the state")

    def equations(self):
        yield self.y == self.x**0.5
        yield der(self.x) == self.u / self.x - self.y


class Lags(Model):
    """Two lags, one behind the other, that start at rest by initial equations; T shapes what u they can start with."""

    T = Parameter(0.1, unit="s", description="time constant")
    u = Input(description="input", start=1.0)
    x = Real(description="behind the input")
    y = Output(description="behind x")

    def equations(self):
        yield self.T * der(self.x) == self.u - self.x - self.x**3
        yield self.T * der(self.y) == self.x - self.y

    def initial_equations(self):
        yield der(self.x) == 0
        yield der(self.y) == 0


MAKERS = {
    "pendulum": lambda: (Pendulum(), {}),
    "sledge": lambda: (Sledge(), {"solver": "rodas4"}),
    "explicit_sledge": lambda: (Sledge(), {}),
    "juggled": lambda: (Juggled(), {}),
    "stiffly_juggled": lambda: (Juggled(), {"solver": "rodas4"}),
    "late": lambda: (Late(), {}),
    "stiffly_late": lambda: (Late(), {"solver": "rodas4"}),
    "thrown": lambda: (ChargedByVoltage(), {}),
    "root": lambda: (Root(), {}),
    "lags": lambda: (Lags(), {}),
    # three equal sides and one that fits: a parallelogram, singular where it is flat
    "parallelogram": lambda: (FourBar(1.0, 0.3, 1.0, 0.3), {}),
    # next to it: the crank turns round, and the loop is almost straight twice a turn
    "nearly_flat": lambda: (FourBar(1.0, 0.3, 1.001, 0.302), {}),
    "robot": lambda: (GantryTau(prototypes.L1), {}),
    "inverse": lambda: (GantryTau(prototypes.L1), {"given": ["tool.r"]}),
    "six_link": lambda: (SixLinkGantryTau(prototypes.D1), {}),
}


@dataclass(frozen=True)
class Unpacked:
    """An exported FMU: folder of its sources, its shared library, token, and value references by name."""

    sources: Path
    library: Path
    token: str
    references: dict[str, int]


@cache
def _folder() -> Path:
    folder = tempfile.mkdtemp(prefix="gantrytau-tests-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


@cache
def unpacked(name: str, fmi: Literal["2.0", "3.0"] = "3.0") -> Unpacked:
    """The FMU of one of MAKERS. The library has the functions of both versions, whatever the file says."""
    from fmpy import read_model_description

    model, options = MAKERS[name]()
    folder = _folder() / f"{name}-{fmi}"
    path = export_fmu(model, folder.with_suffix(".fmu"), fmi=fmi, **options)
    with ZipFile(path) as archive:
        archive.extractall(folder)
    described = read_model_description(path)
    (library,) = (p for p in (folder / "binaries").rglob("*") if p.is_file())
    token = described.guid if fmi == "2.0" else described.instantiationToken
    assert token
    references = {v.name: v.valueReference for v in described.modelVariables}
    return Unpacked(folder / "sources", library, token, references)


def compiler() -> str:
    """GCC, or a skipped test."""
    found = shutil.which("gcc")
    if found is None:
        pytest.skip("no gcc")
    return found


@cache
def driver(model: str, name: str, *options: str) -> Path:
    """A program of tests/fmu/c compiled together with the sources of an FMU, as one unit."""
    program = _folder() / "-".join((model, name, *options)).replace("=", "-").replace(",", "-")
    sources = unpacked(model).sources
    command = [compiler(), "-std=c99", "-D_POSIX_C_SOURCE=200809L", "-g", "-O0", *options]

    def make() -> bytes:
        files = ["-I", str(sources), str(DRIVERS / f"{name}.c"), "-o", str(program), "-lm", "-pthread"]
        done = run([*command, *files])
        assert done.returncode == 0, done.stderr
        return program.read_bytes()

    texts = {file.name: file.read_text() for folder in (sources, DRIVERS) for file in folder.glob("*.[ch]")}
    program.write_bytes(binary([*command, name], texts, make))
    program.chmod(0o755)
    return program


def run(command: Sequence[str | Path], timeout: float = 300) -> subprocess.CompletedProcess[str]:
    """Run a program; what it says is text."""
    return subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=timeout)


SANITIZERS = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-fno-omit-frame-pointer")


@cache
def has_sanitizers() -> bool:
    """Whether gcc has the libraries of its sanitizers."""
    source, program = _folder() / "empty.c", _folder() / "empty"
    source.write_text("int main(void) { return 0; }\n")
    command = [compiler(), *SANITIZERS, str(source), "-o", str(program)]
    return run(command).returncode == 0 and run([program]).returncode == 0
