"""Pages that are generated, in Markdown."""
