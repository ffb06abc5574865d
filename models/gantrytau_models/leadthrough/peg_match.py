"""The match and its hole as a record."""

from dataclasses import dataclass

from gantrytau.border.checks import number


@dataclass(frozen=True)
class Match:
    """A wooden match and the hole for it, SI.

    length, edge: of the match, m, as printed, and depth of the hole, m; modulus of elasticity, Pa. clearance: radius of the
    hole less what the match has, m; the printed 4 mm hole is narrower than the diagonal of the match, so that it stands for
    how far edges and wood give way. wall: stiffness of edges, N/m; mu: friction. What is not printed stands in `assumed`.
    Raises ModelError for what is not above zero (mu: below).
    """

    length: float = 0.095
    edge: float = 0.003
    depth: float = 0.03
    modulus: float = 10e9
    clearance: float = 3e-4
    wall: float = 5e3
    mu: float = 0.3
    source: str = "Dressler (2012), section 8.4"
    assumed: tuple[str, ...] = ("depth", "modulus", "clearance", "wall", "mu")

    def __post_init__(self):
        units = dict(length="m", edge="m", depth="m", modulus="Pa", clearance="m", wall="N/m")
        for name, unit in units.items():
            object.__setattr__(self, name, number("Match", name, getattr(self, name), unit=unit, above=0.0))
        number("Match", "mu", self.mu, least=0.0)

    @property
    def bending(self) -> float:
        """Stiffness at the tip, 3 E I / length^3 with I = edge^4 / 12, N/m."""
        return self.modulus * self.edge**4 / (4 * self.length**3)


WOODEN = Match()
