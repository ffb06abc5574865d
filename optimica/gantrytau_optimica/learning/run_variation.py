"""What differs from run to run of one robot: friction, where it rests in it, and noise of what is measured."""

from dataclasses import dataclass, fields

from gantrytau.border.checks import number


@dataclass(frozen=True, kw_only=True)
class Scatter:
    """Standard deviations of noise, and widths of what is drawn for a run.

    encoder, gauge: m, accelerometer: m/s2, white, of one reading. level: friction is drawn within 1 -+ level of its
    nominal value. rest: friction at the start is drawn within -+ rest of the Coulomb friction, as earlier motion left it.
    Raises ModelError for what is negative or not finite, and for level and rest of 1 and more.
    """

    encoder: float = 1e-6
    gauge: float = 1e-6
    accelerometer: float = 0.07
    level: float = 0.1
    rest: float = 0.6

    def __post_init__(self):
        for one in fields(self):
            below = 1.0 if one.name in ("level", "rest") else None
            number("Scatter", one.name, getattr(self, one.name), least=0.0, below=below)


STILL = Scatter(encoder=0.0, gauge=0.0, accelerometer=0.0, level=0.0, rest=0.0)
