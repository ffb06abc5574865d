"""FMUs of gantrytau models, written and read, and systems of FMUs simulated together."""
