"""Masses and friction of a robot of rigid bodies from its motion and its forces."""
