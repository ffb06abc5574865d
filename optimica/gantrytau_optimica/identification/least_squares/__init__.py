"""Linear least squares of forces, within limits of parameters and conditions on several together."""
