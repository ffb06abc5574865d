"""Linear systems: what they answer in time and in frequency, and their pictures."""
