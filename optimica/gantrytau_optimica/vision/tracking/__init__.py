"""A pattern that moves, image by image."""
