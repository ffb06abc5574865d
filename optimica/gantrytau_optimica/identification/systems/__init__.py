"""Linear models without physics, from measured inputs and outputs."""
