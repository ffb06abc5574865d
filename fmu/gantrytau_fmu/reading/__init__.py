"""FMUs of any tool: read safely, described, checked."""
