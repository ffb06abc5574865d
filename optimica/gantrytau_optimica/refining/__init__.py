"""Answers that hold: played back, refined, and searched from several first guesses."""
