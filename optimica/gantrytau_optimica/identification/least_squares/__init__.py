"""Linear least squares: what columns determine, within limits of parameters and conditions on several together."""
