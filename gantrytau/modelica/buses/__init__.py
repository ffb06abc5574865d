"""Expandable connectors of Modelica text."""
