"""Pictures of filters below what convergence allows: Dressler (2012), Figures 7.14 and 7.17."""

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gantrytau.border.checks import number
from gantrytau.results.figures import check_suffix, finished
from gantrytau_optimica.learning.design.design_q import frequencies, members_of, rest
from gantrytau_optimica.learning.design.q_search import sizes_of
from gantrytau_optimica.learning.design.uncertain_modes import OverFrequencies
from gantrytau_optimica.learning.filters.zero_phase import ZeroPhase
from gantrytau_optimica.learning.laws.learning import Learning

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plot_q(
    q: ZeroPhase,
    responses: OverFrequencies | Sequence[OverFrequencies],
    *,
    learning: Learning | None = None,
    limit: float = 50.0,
    file: str | os.PathLike[str] | None = None,
) -> "Figure":
    """Draw filters, what each axis alone would allow, 1/|1 - L T|, and sigma of all axes, up to `limit` Hz.

    responses, learning: as of `design_q`, whose errors it raises. Returns the figure.
    """
    import matplotlib.pyplot as plt

    if file is not None:
        check_suffix(file)
    limit = number("plot_q", "limit", limit, above=0.0)
    family, law = members_of(responses, learning)
    hz = frequencies(family)
    left = np.array([rest(member, law, hz) for member in family])
    gains = np.broadcast_to(q.magnitude(hz, float(family[0].period or 0.0)), (left.shape[-1], len(hz)))
    figure, axes = plt.subplots(
        len(gains) + 1, 1, figsize=(7.0, 2.0 * len(gains) + 2.4), layout="constrained", sharex=True
    )
    for i, (axis, own) in enumerate(zip(axes, gains, strict=False)):
        alone = np.abs(left[:, :, i, i])
        axis.plot(hz, own, color="C0", label="|Q|")
        axis.plot(hz, 1 / alone.max(axis=0), color="C3", linewidth=1, label="1 / |1 - L T|, the worst of all")
        axis.set(ylabel=f"axis {i + 1}", ylim=(0, 1.6))
    axes[0].legend(loc="upper right")
    sizes = sizes_of(gains, left)
    if len(sizes) > 1:
        low, high = sizes.min(axis=0), sizes.max(axis=0)
        axes[-1].fill_between(hz, low, high, color="C0", alpha=0.3, linewidth=0, label="the whole family")
    axes[-1].plot(hz, sizes.max(axis=0), color="C0", label="the worst of all")
    axes[-1].axhline(1.0, color="C3", linewidth=1, label="errors may grow above")
    axes[-1].legend(loc="lower right")
    axes[-1].set(ylabel="sigma, all axes", xlabel="frequency [Hz]", xlim=(0, limit), ylim=(0, None))
    return finished(figure, file)
