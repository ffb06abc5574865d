"""Answers that hold: better meshes, and several first guesses."""
