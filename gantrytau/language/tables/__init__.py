"""Tables of numbers as expressions, and the files that hold them."""
