"""What fits leave of their data, looked at alike for all of them."""
