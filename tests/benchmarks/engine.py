"""Figures of the compiler and the simulator, beside the closed form written by hand."""

import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import casadi as ca
import numpy as np

from gantrytau import simulate, translate
from gantrytau_models import GantryTau, Pendulum, prototypes
from tests.benchmarks import closed_form
from tests.benchmarks.table import Row, at_most, in_turn, shown, started

FORCES = [f"carts[{k}].f" for k in range(3)]


def by_hand() -> ca.Function:
    """(T, T', f) -> T'' from the closed form of the thesis, parameters folded in as in the model's function."""
    T, v, f = ca.SX.sym("T", 3), ca.SX.sym("v", 3), ca.SX.sym("f", 3)
    return ca.Function(
        "hand", [T, v, f], [closed_form.forward_dynamics(closed_form.GT_A, T, v, f)], {"cse": True}
    )


def from_components() -> ca.Function:
    """(T, T', f) -> T'' from the model."""
    found = translate(GantryTau(prototypes.GT_A)).function(["tool.r", "tool.v", *FORCES], ["der(tool.v)"])
    T, v, f = (ca.MX.sym(name, 3) for name in "Tvf")
    return ca.Function("model", [T, v, f], [found(T, v, f[0], f[1], f[2])])


def rows() -> Iterator[Row]:
    """All figures of the engine."""
    hand, model = by_hand(), from_components()
    yield from _accuracy(hand, model)
    yield shown("right-hand side, instructions by hand", str(hand.n_instructions()))
    # the way that is taken where no pivot is small
    quick = next(f for f in model.find_functions() if f.name() == "f" and f.is_a("SXFunction"))
    ratio = quick.n_instructions() / hand.n_instructions()
    yield at_most("right-hand side, instructions against closed form", ratio, 2.2, "x")
    yield _compiled(hand, model)
    robot = GantryTau(prototypes.GT_A)
    times = in_turn({"translate": lambda: translate(robot)}, 7)
    yield at_most("translating the robot", times["translate"], 0.3, "s")
    yield from _pendulum()
    yield from _starts()


def _accuracy(hand: ca.Function, model: ca.Function) -> Iterator[Row]:
    random = np.random.default_rng(1)
    worst = 0.0
    for _ in range(200):
        T = np.array([0.5, 3.0, -0.6]) + random.uniform(-0.4, 0.4, 3)
        v, f = random.uniform(-1, 1, 3), random.uniform(-1000, 1000, 3)
        a, b = np.array(hand(T, v, f)), np.array(model(T, v, f))
        assert np.all(np.isfinite(a))
        assert np.all(np.isfinite(b))
        worst = max(worst, float(np.linalg.norm(a - b) / np.linalg.norm(a)))
    yield at_most("forward dynamics against closed form, 200 states, relative", worst, 1e-10)
    yield from _other_causalities(random)


def _other_causalities(random: np.random.Generator) -> Iterator[Row]:
    dae = translate(GantryTau(prototypes.GT_A))
    carts = [f"carts[{k}].s" for k in range(3)]
    inverse = dae.function(["tool.r", "tool.v", "der(tool.v)"], FORCES)
    ik, fk = dae.function(["tool.r"], carts), dae.function(carts, ["tool.r"])
    T, v, a = (ca.SX.sym(name, 3) for name in "Tva")
    by_hand = ca.Function("hand", [T, v, a], [closed_form.inverse_dynamics(closed_form.GT_A, T, v, a)])
    forces, tools = 0.0, 0.0
    for _ in range(200):
        pose = np.array([0.5, 3.0, -0.6]) + random.uniform(-0.4, 0.4, 3)
        motion = (pose, random.uniform(-1, 1, 3), random.uniform(-5, 5, 3))
        expected = np.array(by_hand(*motion)).ravel()
        found = np.array(inverse(*motion)).ravel()
        forces = max(forces, float(np.linalg.norm(found - expected) / np.linalg.norm(expected)))
        tools = max(tools, float(np.max(np.abs(np.array(fk(*ik(pose))).ravel() - pose))))
    yield at_most("inverse dynamics against closed form, 200 states, relative", forces, 1e-12)
    yield at_most("forward after inverse kinematics, 200 poses", tools, 1e-11, "m")


def _compiled(hand: ca.Function, model: ca.Function) -> Row:
    with tempfile.TemporaryDirectory() as folder:
        fast = {f.name(): compiled(f, Path(folder), 20000) for f in (hand, model)}
        # each call runs many evaluations inside, so that calling from Python does not count
        points = np.random.default_rng(2).uniform(-0.3, 0.3, (3, 20000))
        T, f = points + np.array([[0.5], [3.0], [-0.6]]), 1000 * points
        times = in_turn({name: lambda g=g: g(T, points, f) for name, g in fast.items()}, 15)
    return at_most(
        "right-hand side, compiled time against closed form", times["model"] / times["hand"], 1.35, "x"
    )


def compiled(function: ca.Function, folder: Path, count: int) -> ca.Function:
    """The function compiled to machine code, evaluated at `count` points in a call."""
    source = folder / f"{function.name()}.c"
    generator = ca.CodeGenerator(source.name)
    generator.add(function)
    generator.generate(f"{folder}/")
    library = source.with_suffix(".so")
    subprocess.run(["cc", "-O2", "-shared", "-fPIC", str(source), "-o", str(library), "-lm"], check=True)
    return ca.external(function.name(), str(library)).map(count)


def _pendulum() -> Iterator[Row]:
    swing = simulate(Pendulum(), stop=100.0, tolerance=1e-8)
    error = float(np.max(np.abs(np.hypot(swing["x"], swing["y"]) - 1.0)))
    yield at_most("pendulum, 100 s at 1e-8, constraint error", error, 1e-10, "m")
    times = in_turn({"simulate": lambda: simulate(Pendulum(), stop=100.0)}, 3)
    yield shown("pendulum, 100 s, translation included", f"{times['simulate']:.3f} s")


def _starts() -> Iterator[Row]:
    """Processor time of what users start: an import, the help, and a command that translates and simulates."""
    command = ("-m", "gantrytau.cli")
    programs = {
        "nothing": ("-c", ""),
        "from gantrytau import *": ("-c", "from gantrytau import *"),
        "gantrytau --help": (*command, "--help"),
        "gantrytau simulate FourBar --stop 2": (*command, "simulate", "FourBar", "--stop", "2"),
    }
    times = started(programs, 5)
    empty = times.pop("nothing")
    yield at_most("from gantrytau import *", times.pop("from gantrytau import *") - empty, 0.4, "s")
    for (title, seconds), limit in zip(times.items(), (0.35, 1.2), strict=True):
        yield at_most(title, seconds, limit, "s")
