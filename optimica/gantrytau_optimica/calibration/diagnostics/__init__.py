"""What to make of measurements and of what a fit leaves."""
