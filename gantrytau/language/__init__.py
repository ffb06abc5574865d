"""The language: what a user writes; no numbers."""
