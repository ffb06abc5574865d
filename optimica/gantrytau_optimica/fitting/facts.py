"""Facts about a fit: kind, quantity, size, rows; the message is made when they are printed."""

from dataclasses import dataclass, field

import numpy as np

from gantrytau.describing.record import Record
from gantrytau_optimica.fitting.finding import Finding, rows_in_words

CAUSES = {  # what a remainder follows -> likeliest causes
    "q": "a spring, or a weight that changes with position",
    "v": "viscous friction",
    "a": "a mass",
    "sign v": "Coulomb friction",
    "gain": "another scale of what was measured",
    "1": "a weight, or an offset of what was measured",
    "time": "it warms up, settles or gives way; wait until it stands, and measure again",
}
WORDS = {  # kind -> what was found
    "explains nothing": "the fit explains {share:.0%} of {quantity}, no more than by chance",
    "noise larger": "what is left of {quantity} is {size:.3g} times the noise that was told (probability {probability:.2g})",
    "noise smaller": "what is left of {quantity} is only {size:.3g} times the noise that was told (probability "
    "{probability:.2g})",
    "not white": "neighbours of what is left of {quantity} correlate by {size:+.2f}, those of noise by less than {held:.2f}",
    "outliers": "what is left of {quantity} in {rows} is off by up to {size:.3g} robust deviations of the others",
    "group": "{cause} leaves {size:.3g} times as much as the others",
    "trend": "what is left of {quantity} follows {cause}, by {size:.4g} of its unit: {share:.0%} of it, {deviations:.3g} "
    "deviations off zero",
    "drift": "what is left of {quantity} drifts over {cause}, by {size:.4g} a {step}: {share:.0%} of it",
    "delay": "{quantity} comes {size:.4g} s {side}: that is {share:.0%} of what is left",
    "limit": "{quantity} stands at its limit {held:.6g}, data want {wanted:.6g}, {deviations:.3g} deviations beyond",
    "fixed": "{quantity} is fixed at {held:.6g}, data want {wanted:.6g}, {deviations:.3g} deviations off",
    "duplicates": "{cause} and {quantity} hold the same values",
}
REMEDIES = {
    "explains nothing": "model and data do not belong together: look at the order of columns, at units and at clocks",
    "noise larger": "the model lacks something, or what was told is too small",
    "noise smaller": "what was told is too large, in another unit perhaps, and deviations of what was found with it",
    "not white": "the model lacks something, or the noise is coloured",
    "outliers": "look at them, or leave them out",
    "group": "look at it, or leave it out",
    "delay": "mend the clocks, or shift one by as much",
    "limit": "the others are pulled along: widen the limit, or look whether the model lacks something",
    "fixed": "the others are pulled along: leave it free, or look at its unit",
    "duplicates": "if they were measured once, give them once, as deviations come out too small",
}


@dataclass(frozen=True, eq=False)
class Fact(Record):
    """Something that a fit shows.

    kind: a key of WORDS; quantity: of which; size: in the sense of its kind; rows: of the data, from 0; cause: signal, group
    or other data that go with it; share: of what is left, or of the signal; deviations: of the statistic, from nothing;
    probability: by chance; held, wanted: of limits and fixed values; remedy: what to do, else that of its kind.
    """

    kind: str
    quantity: str
    size: float = np.nan
    rows: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int), repr=False)
    cause: str = ""
    share: float = np.nan
    deviations: float = np.nan
    probability: float = np.nan
    held: float = np.nan
    wanted: float = np.nan
    remedy: str = ""

    @property
    def finding(self) -> Finding:
        """The fact in words."""
        values = vars(self) | {"rows": rows_in_words(self.rows), "side": "late" if self.size > 0 else "early"}
        values["step"] = {"time": "second", "poses": "pose"}.get(self.cause, "")
        if self.kind == "delay":
            values["size"] = abs(self.size)
        likeliest = CAUSES.get("time" if self.kind == "drift" else self.cause.partition(" of ")[0], "")
        remedy = (
            self.remedy or REMEDIES.get(self.kind) or (f"{likeliest}?" if likeliest else "the model lacks it")
        )
        return Finding(self.kind, self.rows, f"{WORDS[self.kind].format(**values)}; {remedy}")
