"""Blocks of equations that are solved together, in closed form where there is one."""
