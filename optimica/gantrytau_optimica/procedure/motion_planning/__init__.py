"""On which ways poses are visited: clear of collisions, in a good order."""
