"""Between the places of a run: narrow forces, singular poses that are crossed, limits, chatter and rounding."""
