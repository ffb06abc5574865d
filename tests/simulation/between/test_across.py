"""A singular pose is crossed where the motion goes on smoothly: four-bar windows (IFToMM multibody benchmark A02)."""

import numpy as np
import pytest

from gantrytau import DoubtfulResult, Model, ModelError, Real, SolveError, cos, der, simulate, sin, translate

N = 2  # windows
# of the first upright after 1 s: a pendulum, I = (N + 1)/3 + N, by its own equation
TOP = (-0.1950203019, -0.9807992057)


class Windows(Model):
    """N couplers on N + 1 uprights, rods of 1 kg and 1 m: one degree of freedom, N + 1 where all are level.

    phi: uprights from the vertical; x, y, psi: middles and angles of the couplers; f: forces on their left and right ends.
    """

    phi = Real(N + 1, start=[0.0] * (N + 1))
    w = Real(N + 1, start=[1.0] * (N + 1))
    x = Real(N, start=[0.5 + i for i in range(N)])
    y = Real(N, start=[1.0] * N)
    psi = Real(N, start=[0.0] * N)
    v_x = Real(N, start=[1.0] * N)
    v_y = Real(N, start=[0.0] * N)
    w_psi = Real(N, start=[0.0] * N)
    f = Real(4 * N, start=[0.0] * (4 * N))

    def equations(self):
        g, torque = 9.81, [9.81 / 2 * sin(self.phi[k]) for k in range(N + 1)]
        for i in range(N):
            c, s = cos(self.psi[i]) / 2, sin(self.psi[i]) / 2
            left_x, left_y, right_x, right_y = (self.f[4 * i + k] for k in range(4))
            yield self.x[i] - c == i + sin(self.phi[i])
            yield self.y[i] - s == cos(self.phi[i])
            yield self.x[i] + c == i + 1 + sin(self.phi[i + 1])
            yield self.y[i] + s == cos(self.phi[i + 1])
            yield der(self.x[i]) == self.v_x[i]
            yield der(self.y[i]) == self.v_y[i]
            yield der(self.psi[i]) == self.w_psi[i]
            yield der(self.v_x[i]) == left_x + right_x
            yield der(self.v_y[i]) == left_y + right_y - g
            yield der(self.w_psi[i]) / 12 == (left_x - right_x) * s - (left_y - right_y) * c
            torque[i] += left_y * sin(self.phi[i]) - left_x * cos(self.phi[i])
            torque[i + 1] += right_y * sin(self.phi[i + 1]) - right_x * cos(self.phi[i + 1])
        for k in range(N + 1):
            yield der(self.phi[k]) == self.w[k]
            yield der(self.w[k]) / 3 == torque[k]


@pytest.fixture(scope="module")
def windows():
    return translate(Windows())


def test_windows_pass_their_level_pose(windows):
    with pytest.warns(DoubtfulResult, match=r"crossed with the speeds before them at t = 0\.7143.* s"):
        found = simulate(windows, stop=1.0, points=51, tolerance=1e-9, singular="cross")
    first = found.final("phi")[0]
    np.testing.assert_allclose((np.sin(first), np.cos(first)), TOP, rtol=0, atol=1e-6)
    inertia, weight = (N + 1) / 3 + N, 9.81 * ((N + 1) / 2 + N)
    energy = inertia / 2 * found["w"][:, 0] ** 2 + weight * np.cos(found["phi"][:, 0])
    assert np.ptp(energy) < 1e-7 * energy[0]  # a hundred times the tolerance; the pose takes none of it


def test_they_stop_there_if_nothing_else_is_asked(windows):
    with pytest.raises(SolveError, match=r"singular pose at t = 0\.7143.*singular='cross'") as stopped:
        simulate(windows, stop=1.0, points=51)
    assert abs(stopped.value.time - 0.7143) < 1e-3


def test_what_else_is_asked_is_refused(windows):
    with pytest.raises(ModelError, match="found singular='pass', expected 'stop' or 'cross'"):
        simulate(windows, stop=1.0, singular="pass")  # pyright: ignore[reportArgumentType]
