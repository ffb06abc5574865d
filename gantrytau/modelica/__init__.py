"""Text in Modelica 3.6 and Optimica: read to a tree, written from it. The grammar is that of the published specification."""

from gantrytau.modelica.parser import parse, read_tree
from gantrytau.modelica.printer import written
from gantrytau.modelica.source import SourceText

__all__ = ["SourceText", "parse", "read_tree", "written"]
