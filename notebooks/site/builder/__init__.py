"""The site: what is written by hand is staged, what the sources know is generated, Sphinx does the rest."""
