"""Where the tool is, by what was measured in a run."""
