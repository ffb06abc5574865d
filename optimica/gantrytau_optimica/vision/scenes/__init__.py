"""What cameras look at, and the images that they take of it."""
