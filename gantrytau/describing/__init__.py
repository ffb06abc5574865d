"""What things say of themselves: short words for values and records, descriptions as text and HTML, pages, progress."""

from gantrytau.progress import Progress

__all__ = ["Progress"]
