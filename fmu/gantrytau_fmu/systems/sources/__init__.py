"""What can be a component of a system."""
