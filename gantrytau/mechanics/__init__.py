"""Standard mechanics: translational, rotational, multibody."""
