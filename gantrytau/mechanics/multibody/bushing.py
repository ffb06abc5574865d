"""The elastic joint: six stiffnesses and six dampings between two frames."""

import casadi as ca

from gantrytau import Parameter, Real, cross, der, require
from gantrytau.mechanics.multibody.frames import TwoFrames
from gantrytau.mechanics.multibody.orientation import rotation_vector


class Bushing(TwoFrames):
    """A rubber bearing or another elastic joint: `Bushing(c=np.diag([1e6, 1e6, 1e5]), c_phi=np.diag([2e3, 2e3, 500.0]))`.

    It has the energy xi^T C xi / 2 of the displacement xi = (s, phi), C = [[c, c_mixed], [c_mixed^T, c_phi]], and force
    and torque are its derivatives, so that large rotations lose nothing. phi is the rotation vector, axis times angle: it
    is singular at half a turn only, and about one axis the torque is proportional to the angle. Damping acts on the
    velocity of s and on the angular velocity in the same way. The matrices hold in the axes of frame_a.
    """

    c = Parameter(ca.DM(3, 3).full(), unit="N/m", description="stiffness against displacement, (3, 3)")
    c_phi = Parameter(ca.DM(3, 3).full(), unit="N.m/rad", description="stiffness against rotation, (3, 3)")
    c_mixed = Parameter(
        ca.DM(3, 3).full(), unit="N/rad", description="force that goes with a rotation, (3, 3)"
    )
    d = Parameter(ca.DM(3, 3).full(), unit="N.s/m", description="damping of displacement, (3, 3)")
    d_phi = Parameter(ca.DM(3, 3).full(), unit="N.m.s/rad", description="damping of rotation, (3, 3)")
    d_mixed = Parameter(
        ca.DM(3, 3).full(), unit="N.s/rad", description="force that goes with an angular velocity, (3, 3)"
    )
    s = Real(3, unit="m", description="displacement of frame_b, resolved in frame_a")
    phi = Real(3, unit="rad", description="rotation vector of frame_b against frame_a, in frame_a")
    f = Real(3, unit="N", description="force that pulls frame_b back, resolved in frame_a")
    t = Real(3, unit="N.m", description="torque that turns frame_b back, about its origin, in frame_a")
    energy = Real(unit="J", description="elastic energy")

    def equations(self):
        a, b = self.frame_a, self.frame_b
        whole = ca.blockcat([[self.c, self.c_mixed], [self.c_mixed.T, self.c_phi]])
        losses = ca.blockcat([[self.d, self.d_mixed], [self.d_mixed.T, self.d_phi]])
        for matrix, letter in ((whole, "c"), (losses, "d")):
            yield require(
                no_negative_energy(matrix),
                f"expected symmetric {letter} and {letter}_phi, which with {letter}_mixed resist every motion or let it go",
            )
        gap, R = b.r - a.r, ca.SX.sym("R", 3, 3)
        xi = ca.vertcat(self.s, rotation_vector(R))
        energy = ca.dot(xi, whole @ xi) / 2
        # turned a little about an axis n, R becomes R + skew(n) R, and the energy changes by n . moment
        slope = R @ ca.reshape(ca.gradient(energy, ca.vec(R)), 3, 3).T
        moment = ca.vertcat(slope[1, 2] - slope[2, 1], slope[2, 0] - slope[0, 2], slope[0, 1] - slope[1, 0])
        phi, energy, moment = ca.substitute([xi[3:], energy, moment], [R], [a.R.T @ b.R])
        rates = ca.vertcat(a.R.T @ (der(gap) - cross(a.w, gap)), a.R.T @ (b.w - a.w))
        lost = losses @ rates
        yield self.s == a.R.T @ gap
        yield self.phi == phi
        yield self.energy == energy
        yield self.f == self.c @ self.s + self.c_mixed @ self.phi + lost[:3]
        yield self.t == moment + lost[3:]
        yield b.f == a.R @ self.f
        yield b.t == a.R @ self.t
        yield a.f + b.f == 0
        yield a.t + b.t + cross(gap, b.f) == 0


def no_negative_energy(C: ca.SX) -> ca.SX:
    """Whether a (6, 6) matrix is symmetric and positive semidefinite, but for rounding of its rows."""
    size = ca.sqrt(ca.fabs(ca.diag(C))) + 1e-150
    scaled = C / (size @ size.T)
    # semidefinite: definite with a little added to the diagonal. Else a root of Cholesky is nan, and so is their sum
    roots = ca.sum1(ca.diag(ca.chol((scaled + scaled.T) / 2 + 1e-9 * ca.SX.eye(6))))
    symmetric = ca.norm_fro(scaled - scaled.T) < 1e-9
    return ca.logic_and(symmetric, roots > 0)
