"""Where cases are computed, and what is sent there and back."""
