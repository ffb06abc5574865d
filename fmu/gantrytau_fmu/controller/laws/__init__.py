"""What the controller of a user may be."""
