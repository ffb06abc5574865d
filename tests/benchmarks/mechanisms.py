"""Figures of spatial mechanisms: translation, simulation, and forward dynamics beside Pinocchio."""

import tempfile
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import casadi as ca
import numpy as np

from gantrytau import Array, GantryTauError, Model, Start, connect, simulate, translate
from gantrytau.kernels import kernel
from gantrytau.mechanics.multibody import Body, FixedTranslation, Revolute, World
from gantrytau.simulation.full_coordinates import FUNCTIONS, Coordinates
from gantrytau.simulation.motion import all_coordinates
from gantrytau_models import F1GantryTau, SixLinkGantryTau, StewartPlatform, prototypes
from tests.benchmarks.engine import compiled
from tests.benchmarks.peers.with_ida import IDA
from tests.benchmarks.table import Row, at_least, at_most, in_turn, shown
from tests.references import six_link as reference

POSE = np.array([0.9, 2.75, -0.55])  # m
FORCES = (10.0, -5.0, 5.0)  # N
LENGTHS = (5, 10, 20, 40)  # bodies of the chains that show the growth


def chain(count: int) -> Model:
    """A serial chain of revolutes with axes in all directions."""
    axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.3, 1.0]]

    class Chain(Model):
        world = World()
        joints = Array(Revolute, [dict(n=axes[k % 3], phi=Start(0.3 * k)) for k in range(count)])
        bars = Array(FixedTranslation, count, r=[0.0, 0.1, 0.4])
        bodies = Array(Body, count, m=1.0, J=np.diag([0.1, 0.2, 0.25]), r_cm=[0.05, 0.0, 0.2])

        def equations(self):
            at = self.world.frame_b
            for joint, bar, body in zip(self.joints, self.bars, self.bodies, strict=True):
                yield connect(at, joint.frame_a)
                yield connect(joint.frame_b, bar.frame_a)
                yield connect(joint.frame_b, body.frame_a)
                at = bar.frame_b

    return Chain()


def rows() -> Iterator[Row]:
    """All figures of mechanisms."""
    yield from _translation()
    yield from _second_of_the_robot()
    yield from _forward_dynamics()
    yield from _free_body()
    yield _disturbed_starts()


def _translation() -> Iterator[Row]:
    models = {
        "six links": (SixLinkGantryTau(prototypes.L1), 0.8),
        "F1": (F1GantryTau(prototypes.F1), 1.5),
        "chain of 12 revolutes": (chain(12), 1.5),
    }
    for name, (model, limit) in models.items():
        times = in_turn({name: lambda model=model: translate(model)}, 3)
        yield at_most(f"translating: {name}", times[name], limit, "s")
    begin = time.perf_counter()
    translate(StewartPlatform())
    yield shown("translating: Stewart platform", f"{time.perf_counter() - begin:.2f} s")
    found = []
    for count in LENGTHS:
        begin = time.perf_counter()
        translate(chain(count))
        found.append(time.perf_counter() - begin)
    growth = ", ".join(f"{n}: {t:.2f} s" for n, t in zip(LENGTHS, found, strict=True))
    yield shown("translating chains, by bodies", growth)
    exponent = np.polyfit(np.log(LENGTHS[1:]), np.log(found[1:]), 1)[0]
    yield shown("growth of that with the number of bodies", f"n^{exponent:.1f}")


def _six_links() -> Coordinates:
    """The robot with its friction, released at a pose in the middle of its workspace."""
    robot = SixLinkGantryTau(prototypes.L1, tool=dict(r=Start(list(POSE))))
    return all_coordinates(translate(robot), {f"carts[{i}].f": ca.SX(f) for i, f in enumerate(FORCES)})


def _second_of_the_robot() -> Iterator[Row]:
    coordinates = _six_links()
    x, z, _ = coordinates.start(0.0, np.zeros(0))
    run = coordinates.integrator(1, 1e-8)
    kernels = {name: kernel(run.get_function(name), 1e6, wait=True) for name in FUNCTIONS}
    quick = coordinates.integrator(1, 1e-8, functions=kernels)
    peer = IDA(coordinates, 1e-8)
    ends = [one(x0=x, z0=z, p=[0.0, 1.0])["xf"].full().ravel() for one in (run, quick)]
    assert np.array_equal(*ends)
    assert np.abs(ends[0] - peer.run()[: x.size]).max() < 1e-6
    programs = {"run": run, "kernels": quick}
    calls = {name: partial(one, x0=x, z0=z, p=[0.0, 1.0]) for name, one in programs.items()}
    times = in_turn({**calls, "peer": peer.run}, 25)
    title = "six links, 1 s with IDAS at 1e-8"
    yield at_most(f"{title}, integrator made before", 1e3 * times["run"], 3.0, "ms")
    if all(one.class_name() == "External" for one in kernels.values()):
        yield at_most(f"{title}, by kernels that are kept", 1e3 * times["kernels"], 1.5, "ms")
    yield at_most(
        "that against IDA of scikit-SUNDAE on the same functions", times["run"] / times["peer"], 1.0, "x"
    )


def _forward_dynamics() -> Iterator[Row]:
    """All accelerations from all positions, speeds and forces, as the simulator computes them."""
    coordinates = _six_links()
    x, z = coordinates.x, coordinates.z
    matrix = ca.jacobian(coordinates.algebraic, z)
    right = ca.substitute(coordinates.algebraic, z, ca.SX.zeros(*z.shape))
    parts = ca.Function("parts", [x], [matrix, right], {"cse": True})
    rest = ca.Function("rest", [x, z], [coordinates.ode], {"cse": True})
    point = ca.MX.sym("x", x.numel())
    a, b = parts(point)
    ours = ca.Function("six_links", [point], [rest(point, ca.solve(a, -b, "qr"))])
    start, *_ = coordinates.start(0.0, np.zeros(0))
    with tempfile.TemporaryDirectory() as folder:
        fast = compiled(ours, Path(folder), 20000)
        points = np.repeat(start[:, None], 20000, axis=1)
        times = in_turn({"ours": lambda: fast(points)}, 5)
    mine = 1e6 * times["ours"] / 20000
    yield shown("six links, compiled forward dynamics", f"{mine:.2f} us")
    try:
        from tests.benchmarks import pinocchio_reference

        parameters = reference.parameters_L1()
        state = reference.consistent_states(parameters, 1, seed=1)[0]
        call = pinocchio_reference.forward_dynamics(parameters, state, np.array(FORCES))
    except ImportError:
        yield shown("the same in Pinocchio", "pin is not installed")
        return
    theirs = 1e3 * in_turn({"pinocchio": lambda: [call() for _ in range(1000)]}, 5)["pinocchio"]
    yield shown("the same in Pinocchio, called from Python", f"{theirs:.2f} us")
    yield at_most("six links, forward dynamics against Pinocchio", mine / theirs, 1.0, "x")


def _free_body() -> Iterator[Row]:
    class Thrown(Model):
        world = World(g=0.0)
        body = Body(m=2.0, J=np.diag([1.0, 2.0, 2.5]), v=Start([0.3, 0.0, 0.1]), w=Start([0.2, 1.0, 0.1]))

    inertia = np.diag([1.0, 2.0, 2.5])
    motion = simulate(Thrown(), stop=100.0, tolerance=1e-9)
    R, w, v = (np.array(motion[f"body.{name}"]) for name in ("frame_a.R", "w", "v"))
    momentum = np.einsum("kij,jl,kml,km->ki", R, inertia, R, w)
    energy = (np.einsum("ki,ki->k", w, momentum) + 2.0 * np.sum(v**2, axis=1)) / 2
    yield at_most("free body, 100 s at 1e-9, energy", float(np.ptp(energy) / energy[0]), 1e-7)
    drift = np.linalg.norm(momentum - momentum[0], axis=1).max() / np.linalg.norm(momentum[0])
    yield at_most("free body, 100 s at 1e-9, angular momentum", float(drift), 1e-7)


def _disturbed_starts() -> Row:
    """Of 100 starts a fifth of the robot away: found the wanted branch, or said that they did not."""
    random = np.random.default_rng(0)
    good = 0
    for _ in range(100):
        changes = dict(
            tool=dict(
                r=Start(list(POSE + random.uniform(-0.4, 0.4, 3))),
                q=Start(list(np.array([1.0, 0, 0, 0]) + random.uniform(-0.1, 0.1, 4))),
            ),
            carts=[dict(s=Start(s + random.uniform(-0.4, 0.4))) for s in (0.86, 0.8, 0.75)],
        )
        try:
            dae = translate(SixLinkGantryTau(prototypes.L1, friction=None, **changes), units=False)
        except GantryTauError:
            good += 1
            continue
        at = dae.evaluate()
        ends = [
            at[f"arms[{i}].links[0].on_plate.frame_b.r"][0] - at[f"arms[{i}].links[0].on_cart.frame_b.r"][0]
            for i in range(3)
        ]
        good += bool(np.abs(at["tool.R"] - np.eye(3)).max() < 1e-9 and min(ends) > 0)
    return at_least("six links, wanted branch from 100 disturbed starts", good, 95)
