"""Robots that are led by hand while their tool touches something: Dressler (2012), chapter 8."""

from gantrytau_models.leadthrough.peg_control import PegControl
from gantrytau_models.leadthrough.peg_figures import (
    plot_peg_forces,
    plot_peg_orientation,
    plot_peg_torques,
)
from gantrytau_models.leadthrough.peg_in_hole import PegInHole
from gantrytau_models.leadthrough.peg_match import Match, PegDisturbances
from gantrytau_models.leadthrough.peg_tool import PegHand, PegTool

__all__ = [
    "Match",
    "PegControl",
    "PegDisturbances",
    "PegHand",
    "PegInHole",
    "PegTool",
    "plot_peg_forces",
    "plot_peg_orientation",
    "plot_peg_torques",
]
