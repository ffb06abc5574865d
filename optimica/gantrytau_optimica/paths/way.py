"""`Way`: a point that moves along a path, as a component of models and problems."""

from typing import Any

import casadi as ca

from gantrytau import Model, ModelError, Real, StateSelect, der
from gantrytau.border.checks import instance
from gantrytau.border.refusal import Given
from gantrytau_optimica.paths.path import Path


class Way(Model):
    """A point that moves along a path, whose way s is the state.

    path: a Path; further keywords modify members: v=Bounds(-0.5, 0.5), a=Bounds(-2.0, 2.0) limit speed and acceleration
    along it. s has its limits at the ends of the path, and starts in its middle unless told otherwise, as by s=Fixed(0.0).
    """

    s = Real(unit="m", description="way along the path", prefer=StateSelect.ALWAYS)
    v = Real(unit="m/s", description="speed along the path", prefer=StateSelect.ALWAYS, start=0.0)
    a = Real(unit="m/s2", description="acceleration along the path")
    r = Real(3, unit="m", description="place, resolved as the path's points are")

    def __init__(self, path: Path, **modifications: Any):
        self.path = instance("Way", "path", path, Path, "a Path in space; make one with Path.through(points)")
        if path.dimension != 3:
            raise ModelError("expected a Path in space", place="Way", found=Given("path", path))
        super().__init__(dict(s=dict(start=path.length / 2, min=0.0, max=path.length)), **modifications)

    def equations(self):
        yield self.r == self.path(self.s)
        yield self.v == der(self.s)
        yield self.a == der(self.v)

    def errors(self, r: ca.SX) -> tuple[ca.SX, ca.SX]:
        """Contouring error (3,), across the path, and lag error, along it, in m, of a place r (3,) that is to be here.

        For costs of a controller that chooses its own progress (Lam, Manzie, Good, Model predictive contouring control, CDC
        2010).
        """
        place = self.path(self.s)
        tangent = ca.jacobian(place, self.s)
        lag = ca.dot(tangent, place - r)
        return r - place + tangent * lag, lag
