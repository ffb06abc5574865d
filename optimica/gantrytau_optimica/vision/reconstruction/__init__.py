"""From corners in images to places of a robot: relative orientation, bundle adjustment, scale, covariance."""
