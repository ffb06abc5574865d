"""All ways to assemble six links."""
