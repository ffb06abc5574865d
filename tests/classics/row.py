"""A line of a table of classics."""

Row = dict[str, str | float | bool]  # column -> cell; `held`: whether the problem holds what is wanted of it
