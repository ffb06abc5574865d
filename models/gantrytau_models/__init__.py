"""Complete models and robots, built from the components of gantrytau."""

from gantrytau_models import prototypes

__all__ = ["prototypes"]
