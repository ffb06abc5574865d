"""Motions that tell the parameters of a robot well, within the limits of its drives."""
