"""Errors of the carts of D1, and where their effect is looked at: Dressler (2012), section 4.3."""

import numpy as np

# Table 4.2 of Dressler (2012), in m: the same errors in all directions, and less along the guideways
CASE_1 = np.repeat([[32e-6], [77e-6], [54e-6]], 3, axis=1)
CASE_2 = np.array([[11e-6, 28e-6, 28e-6], [58e-6, 38e-6, 38e-6], [19e-6, 47e-6, 47e-6]])


def slice_between_guideways(x: float = 0.0, points: int = 31) -> np.ndarray:
    """Places of the tool of D1 on a plane across its guideways."""
    y, z = np.meshgrid(np.linspace(-4.95, -3.65, points), np.linspace(-0.65, 0.7, points), indexing="ij")
    return np.stack([np.full_like(y, x), y, z], axis=-1).reshape(-1, 3)
