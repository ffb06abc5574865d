"""A tool that is led along a surface, section 8.4 of Dressler (2012)."""
