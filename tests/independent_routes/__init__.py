"""Random models answered on all ways that the package has, and on one that it has not."""
