"""What statements make of values that vary."""
