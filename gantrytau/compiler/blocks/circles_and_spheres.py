"""Two or three quadratics whose quadratic parts are the same: intersecting circles and spheres, in closed form.

f_i(y) = y'Hy/2 + b_i'y + c_i = 0.  Differences of equations are linear and leave a line y = y_0 + t n;
on the line the first equation is a quadratic in t. Nothing is divided but by n'n and n'Hn: that fails only
where the centres lie on a line.
"""

import casadi as ca
import numpy as np

from gantrytau.compiler.blocks.pivots import Guide


def intersection(f: ca.SX, y: ca.SX, guide: Guide) -> list[ca.SX] | None:
    """The solution on the side where the start lies, or None if the equations are of another kind."""
    size = y.numel()
    if size not in (2, 3):
        return None
    jacobian = ca.densify(ca.jacobian(f, y))
    if not _same_curvature(jacobian, y):
        return None
    first = f[0]
    linear = _at_zero(jacobian - ca.repmat(jacobian[0, :], size, 1), y)  # the same at every y
    a = [linear[i, :].T for i in range(1, size)]
    d = [-_at_zero(f[i] - first, y) for i in range(1, size)]
    if size == 2:
        line = ca.vertcat(-a[0][1], a[0][0])
        point = a[0] * d[0] / ca.dot(a[0], a[0])
    else:
        line = ca.cross(a[0], a[1])
        point = (d[0] * ca.cross(a[1], line) + d[1] * ca.cross(line, a[0])) / ca.dot(line, line)
    slope = ca.dot(ca.substitute(jacobian[0, :].T, y, point), line)
    curvature = ca.dot(line, ca.mtimes(ca.jacobian(jacobian[0, :].T, y), line))
    middle = point - slope / curvature * line
    reach = ca.sqrt(-2 * ca.substitute(first, y, middle) / curvature)
    side = float(guide.at_start(ca.dot(line, y - middle))[0, 0])
    return (middle + (1.0 if side >= 0 else -1.0) * reach * line).elements()


def _same_curvature(jacobian: ca.SX, y: ca.SX) -> bool:
    """Whether all equations are quadratic with one and the same constant, definite second derivative."""
    first = ca.densify(ca.jacobian(jacobian[0, :].T, y))
    if not first.is_constant():
        return False
    sizes = np.linalg.eigvalsh(np.array(ca.DM(first)))
    if not sizes[0] * sizes[-1] > 0:  # along some line the curvature vanishes
        return False
    for i in range(1, jacobian.shape[0]):
        other = ca.densify(ca.jacobian(jacobian[i, :].T, y))
        if not other.is_constant() or not ca.DM(other - first).is_zero():
            return False
    return True


def _at_zero(expression: ca.SX, symbols: ca.SX) -> ca.SX:
    return ca.substitute(expression, symbols, ca.SX.zeros(*symbols.shape))
