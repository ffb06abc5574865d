"""Names of a model as a typesetter sees them: Greek letters, subscripts, dots for derivatives."""

import re
from dataclasses import dataclass

from gantrytau.language.symbols import split_derivative

# the written table of letters: phi angle, w angular velocity, tau torque; the rest are letters themselves
GREEK = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "epsilon": "ε", "zeta": "ζ", "eta": "η",
    "theta": "θ", "kappa": "κ", "lambda": "λ", "lambda_": "λ", "mu": "μ", "nu": "ν", "xi": "ξ", "rho": "ρ",
    "sigma": "σ", "tau": "τ", "phi": "φ", "chi": "χ", "psi": "ψ", "omega": "ω", "w": "ω", "th": "θ",
    "Gamma": "Γ", "Theta": "Θ", "Lambda": "Λ", "Xi": "Ξ", "Phi": "Φ", "Psi": "Ψ", "Omega": "Ω",
}  # fmt: skip
NUMBERED = re.compile(r"([^\W\d_]+)(\d+)")  # phi1, q12
MOST_DOTS = 2
MOST_TAILS = 2  # below a letter


@dataclass(frozen=True)
class Part:
    """One member of a dotted name: its base (a letter, a Greek letter or a word) and what stands below it."""

    base: str
    below: tuple[str, ...]

    @property
    def letter(self) -> bool:
        """Whether the base is one letter."""
        return len(self.base) == 1


@dataclass(frozen=True)
class Name:
    """A scalar: the parts of its dotted name, and how often it is differentiated."""

    parts: tuple[Part, ...]
    order: int

    @property
    def dotted(self) -> bool:
        """Whether the derivative is shown by dots, over a single letter."""
        return 0 < self.order <= MOST_DOTS and self.parts[-1].letter


def name_of(name: str) -> Name:
    """`der(carts[0].v_x)` taken apart."""
    base, order = split_derivative(name)
    if "(" in base:  # what was: delay(x, 0.5), pre(x)
        return Name((Part(base, ()),), order)
    return Name(tuple(_part(member) for member in base.split(".")), order)


def _part(member: str) -> Part:
    word, _, inside = member.partition("[")
    indices = tuple(i for i in inside.rstrip("]").split(",") if i)
    if word in GREEK:
        return Part(GREEK[word], indices)
    head, *tails = word.split("_")
    numbered = NUMBERED.fullmatch(head)
    head, digits = (numbered[1], (numbered[2],)) if numbered else (head, ())
    letter = GREEK.get(head, head)
    # v_x, phi_rel, q1; kinetic_energy stays a word
    if len(letter) == 1 and all(tails) and len(tails) <= MOST_TAILS:
        return Part(letter, (*digits, *tails, *indices))
    return Part(word, indices)
