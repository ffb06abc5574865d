"""What is between the places of a run: narrow forces, singular poses that are crossed, and what rounding makes of it."""
