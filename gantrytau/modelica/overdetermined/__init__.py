"""Overdetermined connectors: records that are passed on along a spanning tree of the connectors, and `Connections.*`."""
