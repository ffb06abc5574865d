"""Two masses on springs, coupled by a third, each an FMU; and their motion."""

import numpy as np

from tests.fmu.systems.small_fmus import variable

# a mass on a spring under a force f that is held over the step, exactly; v: f, x, v, k, m
MASS = """double k = v[3], w = sqrt(k / v[4]), x0 = v[0] / k, x = v[1] - x0, u = v[2];
v[1] = x0 + x * cos(w * h) + u / w * sin(w * h); v[2] = -w * x * sin(w * h) + u * cos(w * h);"""
# the same with a coupling spring c to a place u that is held; v: u, x, v, k, m, c, f
COUPLED = """double k = v[3] + v[5], w = sqrt(k / v[4]), x0 = v[5] * v[0] / k, x = v[1] - x0, u = v[2];
v[1] = x0 + x * cos(w * h) + u / w * sin(w * h); v[2] = -w * x * sin(w * h) + u * cos(w * h);"""
K, C = 100.0, 20.0  # N/m, both masses 1 kg
WIRES = [("a.x", "b.u"), ("b.f", "a.f")]


def exact(t):
    """Both masses, of which the first begins at 0.1 m: half the sum and difference of the two modes."""
    together, apart = np.cos(np.sqrt(K) * t), np.cos(np.sqrt(K + 2 * C) * t)
    return 0.05 * (together + apart), 0.05 * (together - apart)


def first(build, fmi="2.0", name="a", **more):
    lines = [
        variable("f", "input", 0.0, unit="N"),
        variable("x", "output", 0.1, unit="m"),
        variable("v", "output", unit="m/s"),
        variable("k", "parameter", K, unit="N/m"),
        variable("m", "parameter", 1.0, unit="kg"),
    ]
    return build(f"{name}{fmi[0]}", lines, **{"advance": MASS, "fmi": fmi, **more})


def second(build, fmi="2.0", name="b", unit="m", **more):
    lines = [
        variable("u", "input", 0.0, unit=unit),
        variable("x", "output", 0.0, unit="m"),
        variable("v", "output", unit="m/s"),
        variable("k", "parameter", K, unit="N/m"),
        variable("m", "parameter", 1.0, unit="kg"),
        variable("c", "parameter", C, unit="N/m"),
        variable("f", "output", unit="N"),
    ]
    code = {"advance": COUPLED, "derive": "v[6] = v[5] * (v[1] - v[0]);", "direct": ("f",)}
    return build(f"{name}{fmi[0]}", lines, **{**code, "fmi": fmi, **more})
