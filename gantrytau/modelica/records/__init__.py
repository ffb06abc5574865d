"""Records: their values, the operators that they define, and what assignments change in them."""
