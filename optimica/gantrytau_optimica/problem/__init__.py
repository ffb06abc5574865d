"""The language of optimisation problems, read and checked."""
