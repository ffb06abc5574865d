"""States, slow parameters and disturbances of a model from noisy samples."""
