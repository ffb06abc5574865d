"""Standard mechanics: translational, rotational, multibody; the two laws of friction along an axis are offered here."""

from typing import TYPE_CHECKING

from gantrytau.door import door

if TYPE_CHECKING:
    from gantrytau.mechanics.translational import LinearFriction, TanhFriction

__all__ = ["LinearFriction", "TanhFriction"]

__getattr__, __dir__ = door(__name__)
