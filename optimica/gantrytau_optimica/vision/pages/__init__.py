"""Pages that show what became of images."""
