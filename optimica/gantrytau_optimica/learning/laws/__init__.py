"""What is learnt from an error, and whether it converges."""
