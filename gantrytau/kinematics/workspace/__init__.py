"""Where the tool can go, and what stops it."""
