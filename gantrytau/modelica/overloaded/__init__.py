"""What operator records define."""
