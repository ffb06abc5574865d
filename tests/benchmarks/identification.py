"""Masses of the three-link robot from 10,250 rows, beside scipy with differences; servos, and what they move."""

import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from pathlib import Path

import casadi as ca
import numpy as np
import pandas
from nfoursid.nfoursid import NFourSID
from scipy.optimize import least_squares

from gantrytau import translate
from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import identify_servo, identify_system, physical_form
from gantrytau_optimica.identification.rigid.robot_dynamics import (
    RobotDynamics,
    candidates,
    drives,
    frictions,
    model_name,
)
from tests.benchmarks.table import Row, at_least, at_most
from tests.optimica.identification import gantry_logs as logs
from tests.optimica.identification.measured import test_identify_servo as servos
from tests.optimica.identification.measured import test_identify_system as systems
from tests.optimica.identification.measured import test_physical_form as structures


def servo_and_structure() -> Iterator[Row]:
    """Processor time of three servos from nine steps, and of mass, damping and stiffness from 4000 samples."""
    steps = 3 * servos.steps(servos.NOISE)
    u, y = structures.measured(structures.TRUE, 1, 5e-5)
    box = structures.black_box(u, y)
    begin = time.process_time()
    servo = identify_servo(steps)
    middle = time.process_time()
    form = physical_form(box, measured=(u, y))
    end = time.process_time()
    assert np.allclose(servo.pole, servos.POLE, rtol=0, atol=1e-4)
    assert max(structures.off(form)) < 0.01
    yield at_most("three servos from nine steps of 400 samples", middle - begin, 2.0, "s")
    yield at_most("mass, damping and stiffness from 4000 samples", end - middle, 2.0, "s")


def subspaces() -> Iterator[Row]:
    """Processor time of a model of order 8 from 1500 samples, of nfoursid's, and of one of order 10 from 6000."""
    count, hankel = 1500, 12
    u, y = systems.INPUTS, systems.noisy(0.05)
    frame = pandas.DataFrame(np.hstack([u, y])[:count], columns=["u0", "u1", "u2", "y0", "y1"])
    begin = time.process_time()
    identify_system(u[:count], y[:count], order=8, period=systems.PERIOD, block_rows=hankel)
    middle = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        other = NFourSID(frame, ["y0", "y1"], ["u0", "u1", "u2"], num_block_rows=hankel)
        other.subspace_identification()
        other.system_identification(rank=8)
    end = time.process_time()
    found = identify_system(u, y, order=10, period=systems.PERIOD)
    last = time.process_time()
    assert np.all(found.fit(u, systems.OUTPUTS) > 95)
    yield at_least("linear model of order 8, nfoursid takes", (end - middle) / (middle - begin), 3.0)
    yield at_most("linear model of order 10 from 6000 samples", last - end, 1.0, "s")


READING = """
import sys, time
from numpy import loadtxt
from gantrytau_optimica import MotionLog
from tests.benchmarks.table import peak_memory
begin = time.process_time()
log = {reader}
print(time.process_time() - begin, peak_memory(), len(log))
"""
READERS = ("MotionLog.read(sys.argv[1])", "loadtxt(sys.argv[1], delimiter=',', skiprows=1)")


def log_files() -> Iterator[Row]:
    """Processor time and memory (GB) of reading a million rows of three actuators, each reader in a process of its own."""
    count = 1_000_000
    t = 0.004 * np.arange(count)
    wave = np.sin(np.outer(t, [1.0, 1.1, 1.2]))
    columns = ["t", *(f"q{k + 1} [mm]" for k in range(3)), *(f"f{k + 1}" for k in range(3))]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        table = pandas.DataFrame(np.column_stack([t, 1e3 * wave, 100 * wave]), columns=columns)
        table.to_csv(path, index=False, float_format="%.6f")
        codes = [READING.format(reader=reader) for reader in READERS]
        told = [subprocess.check_output([sys.executable, "-c", code, str(path)], text=True) for code in codes]
    (seconds, memory, found), (other, _, _) = (map(float, line.split()) for line in told)
    assert found == count
    yield at_most("a million rows of a log are read", seconds, 5.0, "s")
    yield at_most("of numpy.loadtxt, which knows no header", seconds / other, 1.5)
    yield at_most("memory of that", memory, 2.0, "GB")


def rows() -> Iterator[Row]:
    """Processor time of one regression, and of scipy's differences from ones to the same masses."""
    dae = translate(GantryTau(prototypes.L1))
    joints, forces = drives(dae)
    dynamics = RobotDynamics(dae, joints, forces, candidates(dae), dict.fromkeys(frictions(dae), 0.0))
    _, q, v, a, _ = logs.motion()
    x, f = np.hstack([q, v, a]), logs.log(0).f
    names = [*joints, *(f"der({n})" for n in joints), *(f"der(der({n}))" for n in joints)]
    given = [*names, *(model_name(dae, n) for n in dynamics.names), *frictions(dae)]
    inverse = dae.function(given=given, find=forces).expand().map(len(x))
    ones = np.ones((1, len(x)))

    def left(p: np.ndarray) -> np.ndarray:
        found = inverse(*x.T[:, None], *(k * ones for k in p), *[0.0] * len(frictions(dae)))
        return (np.asarray(ca.vertcat(*found)).T - f).ravel()

    dynamics.slopes(x[:10], dynamics.nominal)  # builds the function
    begin = time.process_time()
    A, y = dynamics.slopes(x, dynamics.nominal)
    p = np.linalg.lstsq(A.reshape(f.size, -1), (f - y + A @ dynamics.nominal).ravel(), rcond=None)[0]
    middle = time.process_time()
    found = least_squares(left, np.ones(len(p)))
    end = time.process_time()
    assert np.allclose(found.x, p, rtol=1e-3, atol=1e-3)  # the same masses, as closely as differences go
    yield at_least("masses by regression, scipy's differences take", (end - middle) / (middle - begin), 15.0)
    yield from servo_and_structure()
    yield from subspaces()
    yield from log_files()
