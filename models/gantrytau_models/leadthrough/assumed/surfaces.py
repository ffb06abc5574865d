"""Surfaces to lead a tool along: `surfaces.CARDBOARD`, `.METAL`. Their values are assumed, not printed: surfaces.toml."""

from gantrytau_models.leadthrough.assumed.records import SurfaceRecord, read

CARDBOARD: SurfaceRecord = read("surfaces", "CARDBOARD")
METAL: SurfaceRecord = read("surfaces", "METAL")
