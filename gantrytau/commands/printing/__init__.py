"""What commands answer: sentences, JSON, pictures, files."""
