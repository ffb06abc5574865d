"""What to measure: identifiability and the choice of poses."""
