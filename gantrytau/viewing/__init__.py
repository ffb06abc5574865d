"""Pictures of models: what their components look like, in a pose or in motion, on one page for any browser."""

from gantrytau.viewing.animate import animate, view
from gantrytau.viewing.page import Page

__all__ = ["Page", "animate", "view"]
