"""Parameters of dynamic models from measured data."""
