"""Laws of friction over a speed and of stops, the same along an axis (N, m, m/s) and about it (N.m, rad, rad/s)."""

from typing import Any

from gantrytau import between, exp, fmax, fmin, if_else, tanh


def linear_sign(slope: Any) -> Any:
    """The sign of a speed, smoothed piecewise linearly (Dressler 2012, Figure 3.6). slope: speed over smoothing speed."""
    return if_else(between(-1, slope, 1), slope, if_else(slope > 0, 1, -1))


def asymmetric_friction(speed: Any, coulomb: Any, viscous: Any, smoothing: Any) -> Any:
    """Coulomb and viscous friction that differ with the direction, the sign smoothed by tanh.

    coulomb, viscous: two elements each, at positive and at negative speed; smoothing: the smoothing speed. Each side counts
    by its share (1 + tanh(speed / smoothing)) / 2, so that force and slope have no jump.
    """
    sign = tanh(speed / smoothing)
    plus, minus = (1 + sign) / 2, (1 - sign) / 2
    return (coulomb[0] * plus + coulomb[1] * minus) * sign + (viscous[0] * plus + viscous[1] * minus) * speed


def stribeck_friction(speed: Any, smoothing: Any, coulomb: Any, static: Any, fall_speed: Any, n: Any) -> Any:
    """Friction that falls from static to Coulomb with the speed (Armstrong-Helouvry 1994), the sign smoothed by tanh.

    (coulomb + (static - coulomb) exp(-(|speed| / fall_speed)^n)) tanh(speed / smoothing).
    """
    slope = speed / smoothing
    sign = tanh(slope)
    # the size of the speed, but the smoothing speed at rest, where the sign is zero: smooth for any exponent
    size = smoothing * (slope * sign + 1 - sign**2)
    return (coulomb + (static - coulomb) * exp(-((size / fall_speed) ** n))) * sign


def dahl_rate(speed: Any, z: Any, stiffness: Any, coulomb: Any) -> Any:
    """The rate of the deflection z before sliding (Dahl 1968): speed - stiffness |speed| z / coulomb."""
    # no event where the speed changes its sign: the rate only bends there, by as much as a step can bear
    return speed - stiffness * if_else(speed > 0, speed, -speed, smooth=True) * z / coulomb


def end_stop(place: Any, speed: Any, ends: tuple[Any, Any], stiffness: Any, a: Any) -> Any:
    """The force of stops at both ends of a way (Hunt, Crossley 1975), against the motion beyond them; it never pulls.

    stiffness p (1 + 3/2 a v), where p is the depth and v its rate: what hits with v_0 loses about a v_0 of its speed.
    """
    low, high = place - ends[0], place - ends[1]
    push = fmax(stiffness * high * (1 + 1.5 * a * speed), 0)
    pull = fmin(stiffness * low * (1 - 1.5 * a * speed), 0)
    return if_else(high > 0, push, if_else(low < 0, pull, 0))
